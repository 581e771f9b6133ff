# The address sanitizer and, of undefined behaviour, what costs little: without the checks at every pointer, which are half of the
# compile time and more than half of the running time. Sourced.
# shellcheck shell=bash disable=SC2034  # for those who source it
cheap_checks=address,signed-integer-overflow,float-cast-overflow,bounds,shift,integer-divide-by-zero,enum,bool,return,unreachable,builtin
