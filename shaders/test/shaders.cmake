# Kernels of tests/gpu only.
plumb_add_shader(test/axpy test/axpy.comp)
plumb_add_shader(test/texel_copy test/texel_copy.comp)
plumb_add_shader(test/address_double test/address_double.comp)
plumb_add_shader(test/loop_budget test/loop_budget.comp NO_OPT)  # The loops are the test.
