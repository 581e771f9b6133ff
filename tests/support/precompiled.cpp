// The unit to which the precompiled headers of the tests belong.
