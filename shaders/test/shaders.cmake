# Kernels of tests/gpu only.
plumb_add_shader(test/axpy test/axpy.comp)
plumb_add_shader(test/loop_budget test/loop_budget.comp NO_OPT)  # The loops are the test.
