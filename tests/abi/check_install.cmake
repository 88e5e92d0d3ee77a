# Installs the component `library` and builds the minimal program outside of the tree against it, once
# through the CMake package and once through pkg-config; both must run.
# -DBUILD= -DSOURCE= -DWORK= -DFIXTURE= -DGENERATOR= -DC_COMPILER= -DPKG_CONFIG= -DLIBDIR=
cmake_minimum_required(VERSION 3.25)
file(REMOVE_RECURSE ${WORK})
execute_process(COMMAND ${CMAKE_COMMAND} --install ${BUILD} --component library --prefix ${WORK}/prefix
  OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
file(GLOB_RECURSE installed RELATIVE ${WORK}/prefix ${WORK}/prefix/*)
foreach(expected include/plumbline/plumbline.h ${LIBDIR}/libplumbline.so
        ${LIBDIR}/pkgconfig/plumbline.pc ${LIBDIR}/cmake/plumbline/plumblineConfig.cmake)
  if(NOT expected IN_LIST installed)
    message(FATAL_ERROR "${expected} is not installed, only ${installed}")
  endif()
endforeach()
# Whoever moves the tree moves all of it.
file(RENAME ${WORK}/prefix ${WORK}/moved)

execute_process(COMMAND ${CMAKE_COMMAND} -S ${SOURCE}/install_consumer -B ${WORK}/build -G ${GENERATOR}
    -DCMAKE_C_COMPILER=${C_COMPILER} -DCMAKE_PREFIX_PATH=${WORK}/moved
  OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CMAKE_COMMAND} --build ${WORK}/build OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CMAKE_COMMAND} -DPROGRAM=${WORK}/build/refine_one -DFIXTURE=${FIXTURE}
    -P ${SOURCE}/check_program.cmake COMMAND_ERROR_IS_FATAL ANY)

set(ENV{PKG_CONFIG_PATH} ${WORK}/moved/${LIBDIR}/pkgconfig)
execute_process(COMMAND ${PKG_CONFIG} --cflags --libs plumbline OUTPUT_VARIABLE flags
  OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${PKG_CONFIG} --modversion plumbline OUTPUT_VARIABLE version
  OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
if(NOT version MATCHES "^[0-9]+\\.[0-9]+\\.[0-9]+$")
  message(FATAL_ERROR "plumbline.pc has the version '${version}'")
endif()
separate_arguments(flags)
execute_process(COMMAND ${C_COMPILER} -std=c99 ${SOURCE}/refine_one.c -o ${WORK}/refine_one ${flags}
    -Wl,-rpath,${WORK}/moved/${LIBDIR} COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CMAKE_COMMAND} -DPROGRAM=${WORK}/refine_one -DFIXTURE=${FIXTURE}
    -P ${SOURCE}/check_program.cmake COMMAND_ERROR_IS_FATAL ANY)
