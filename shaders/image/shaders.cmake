# Image preprocessing; names are image/<file>_<kernel family>.
plumb_add_shader(image/preprocess_cpu_simd image/preprocess.comp DEFINES PLUMB_CPU_SIMD=1)
plumb_add_shader(image/preprocess_gpu image/preprocess.comp DEFINES PLUMB_CPU_SIMD=0)
