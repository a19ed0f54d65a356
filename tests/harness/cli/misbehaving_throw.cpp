#include <stdexcept>

extern "C" void throw_exception();
void throw_exception() { throw std::out_of_range("beyond the last sensor"); }
