/* Of string.h what the core uses: instructions of WebAssembly. */
#ifndef CFEM_PAGE_STRING_H
#define CFEM_PAGE_STRING_H

#include <stddef.h>

#define memcpy __builtin_memcpy
#define memmove __builtin_memmove
#define memset __builtin_memset

#endif
