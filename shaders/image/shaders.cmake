# Image preprocessing; names are image/<file>_<kernel family>.
foreach(family IN ITEMS cpu_simd:1 gpu:0)
  string(REGEX MATCH "(.*):(.*)" _ ${family})
  plumb_add_shader(image/preprocess_${CMAKE_MATCH_1} image/preprocess.comp
    DEFINES PLUMB_CPU_SIMD=${CMAKE_MATCH_2})
endforeach()
