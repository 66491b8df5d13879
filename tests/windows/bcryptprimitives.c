/* Wine 8 lacks this library of Windows, of which programs in Rust want one function. */
#include <windows.h>

BOOLEAN NTAPI SystemFunction036(void *bytes, ULONG count); /* RtlGenRandom */

__declspec(dllexport) BOOL WINAPI ProcessPrng(unsigned char *bytes, SIZE_T count) {
  return SystemFunction036(bytes, (ULONG)count);
}
