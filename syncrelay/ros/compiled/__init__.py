"""An extension module that is built where there is a C compiler when syncrelay is installed; all works without it."""
