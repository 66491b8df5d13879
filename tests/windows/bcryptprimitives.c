/* Wine 8 lacks this library of Windows; programs in Rust need one of its functions. */
#include <windows.h>

BOOLEAN NTAPI SystemFunction036(void *bytes, ULONG count); /* RtlGenRandom */

__declspec(dllexport) BOOL WINAPI ProcessPrng(unsigned char *bytes, SIZE_T count) {
  return SystemFunction036(bytes, (ULONG)count);
}
