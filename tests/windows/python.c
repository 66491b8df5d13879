/* python.exe: the program itself is in python3*.dll, in the same folder. */
#include <windows.h>
#include <stdio.h>

int wmain(int argc, wchar_t **argv) {
  HMODULE library = LoadLibraryW(L"" PYTHON_DLL);
  if (!library) return fprintf(stderr, "no %s\n", PYTHON_DLL), 1;
  int (*run)(int, wchar_t **) = (void *)GetProcAddress(library, "Py_Main");
  return run(argc, argv);
}
