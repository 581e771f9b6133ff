// Clang 14's leak checker itself crashes at the end of some programs that used OpenCV's threads ("Tracer caught signal
// 11"), also with one thread and without registers, stacks or thread-local memory to search. It stays on in all tests
// without OpenCV's libraries.
extern "C" const char* __asan_default_options() { return "detect_leaks=0"; }
