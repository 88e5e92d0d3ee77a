# Decoding of the network's output; names are decode/<file>_<kernel family>.
foreach(kernel IN ITEMS score select emit)
  plumb_add_shader(decode/${kernel}_cpu_simd decode/${kernel}.comp DEFINES PLUMB_CPU_SIMD=1)
  plumb_add_shader(decode/${kernel}_gpu decode/${kernel}.comp DEFINES PLUMB_CPU_SIMD=0)
endforeach()
