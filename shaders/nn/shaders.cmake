# Kernels of the network; names are nn/<file>[_variant].
