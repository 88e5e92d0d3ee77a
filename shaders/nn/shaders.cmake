# Kernels of the network; names are nn/<file>[_variant].

# Family cpu-simd. NO_OPT: the kernels depend on loops over specialization constants that the driver
# unrolls; rewriting them first can only hide the pattern.
foreach(suffix "" "_address")
  set(address)
  if(suffix)
    set(address WEIGHT_ADDRESS=1)
  endif()
  plumb_add_shader(nn/p8_conv1x1${suffix} nn/p8_conv.comp DEFINES SHAPE=0 ${address} NO_OPT)
  plumb_add_shader(nn/p8_conv3x3${suffix} nn/p8_conv.comp DEFINES SHAPE=1 ${address} NO_OPT)
  plumb_add_shader(nn/p8_winograd${suffix} nn/p8_winograd.comp DEFINES ${address} NO_OPT)
  plumb_add_shader(nn/p8_cross7${suffix} nn/p8_conv.comp DEFINES SHAPE=2 ${address} NO_OPT)
endforeach()
plumb_add_shader(nn/p8_stem nn/p8_stem.comp NO_OPT)
plumb_add_shader(nn/p8_max_pool nn/p8_max_pool.comp NO_OPT)

# Family gpu.
plumb_add_shader(nn/tile_conv nn/tile_conv.comp)
plumb_add_shader(nn/tile_max_pool nn/tile_max_pool.comp)
