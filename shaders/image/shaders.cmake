# Image preprocessing; names are image/<file>.
