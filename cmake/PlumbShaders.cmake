# plumb_add_shader(nn/gemm_texel nn/gemm.comp [DEFINES USE_TEXEL=1 ...] [NO_OPT])
# Compiles shaders/nn/gemm.comp (Vulkan 1.2) and embeds it under the name "nn/gemm_texel".
# Includes are searched in the file's folder, shaders/include and shaders/.
# NO_OPT skips spirv-opt -O, for kernels whose loops must stay as written; say why at the call.
function(plumb_add_shader name source)
  cmake_parse_arguments(ARG "NO_OPT" "" "DEFINES" ${ARGN})
  set(in ${PROJECT_SOURCE_DIR}/shaders/${source})
  set(out ${PROJECT_BINARY_DIR}/shaders/${name})
  cmake_path(GET out PARENT_PATH folder)
  file(MAKE_DIRECTORY ${folder})
  list(TRANSFORM ARG_DEFINES PREPEND -D OUTPUT_VARIABLE defines)
  set(optimise ${PLUMB_SPIRV_OPT} -O)
  if(ARG_NO_OPT)
    set(optimise ${PLUMB_SPIRV_OPT} --strip-debug)
  endif()
  add_custom_command(
    OUTPUT ${out}.spv
    DEPFILE ${out}.d
    DEPENDS ${in}
    COMMAND ${PLUMB_GLSLANG} --quiet --target-env vulkan1.2 ${defines}
            -I${PROJECT_SOURCE_DIR}/shaders/include -I${PROJECT_SOURCE_DIR}/shaders
            --depfile ${out}.d -o ${out}.spv ${in}
    COMMENT "GLSL ${name}" VERBATIM)
  add_custom_command(
    OUTPUT ${out}.inc
    DEPENDS ${out}.spv ${PROJECT_SOURCE_DIR}/cmake/EmbedSpirv.cmake
    COMMAND ${optimise} --target-env=vulkan1.2 ${out}.spv -o ${out}.opt.spv
    COMMAND ${PLUMB_SPIRV_VAL} --target-env vulkan1.2 --scalar-block-layout ${out}.opt.spv
    COMMAND ${CMAKE_COMMAND} -DIN=${out}.opt.spv -DOUT=${out}.inc
            -P ${PROJECT_SOURCE_DIR}/cmake/EmbedSpirv.cmake
    COMMENT "SPIR-V ${name}" VERBATIM)
  set_property(GLOBAL APPEND PROPERTY PLUMB_SHADERS ${name})
endfunction()

# plumb_add_shader_library(plumb_shaders): the registry of all shaders added so far, as plumb::shaders.
function(plumb_add_shader_library target)
  get_property(names GLOBAL PROPERTY PLUMB_SHADERS)
  set(arrays "")
  set(entries "")
  set(includes "")
  foreach(name IN LISTS names)
    string(MAKE_C_IDENTIFIER ${name} id)
    string(APPEND arrays "constexpr uint32_t k_${id}[] = {\n#include \"${name}.inc\"\n};\n")
    string(APPEND entries "    {\"${name}\", k_${id}},\n")
    list(APPEND includes ${PROJECT_BINARY_DIR}/shaders/${name}.inc)
  endforeach()
  set(PLUMB_SHADER_ARRAYS "${arrays}")
  set(PLUMB_SHADER_ENTRIES "${entries}")
  configure_file(${PROJECT_SOURCE_DIR}/shaders/registry.cc.in
                 ${PROJECT_BINARY_DIR}/shaders/registry.cc @ONLY)
  add_library(${target} STATIC ${PROJECT_BINARY_DIR}/shaders/registry.cc ${includes})
  add_library(plumb::shaders ALIAS ${target})
  target_compile_features(${target} PUBLIC cxx_std_20)
  target_link_libraries(${target} PRIVATE $<BUILD_INTERFACE:plumb_flags>)
  target_include_directories(${target}
    PUBLIC ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/shaders/include
    PRIVATE ${PROJECT_BINARY_DIR}/shaders)
endfunction()
