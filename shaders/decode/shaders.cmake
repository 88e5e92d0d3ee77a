# Decoding of the network's output; names are decode/<file>.
