// SPDX-License-Identifier: MIT
// Macros of the programs that use the library, defined after the system's headers and Eigen's and before ours.
#pragma once

#include <cassert>

// <windows.h>
#define near
#define far
#define small char
#define interface struct
#define pascal
#define cdecl
#define hyper 1.5
#define min(a, b) (((a) < (b)) ? (a) : (b))
#define max(a, b) (((a) > (b)) ? (a) : (b))
#define IN
#define OUT
#define OPTIONAL
#define CONST const
#define VOID void
#define ERROR 0
#define DELETE 0x00010000L
#define TRUE 1
#define FALSE 0
#define DIFFERENCE 11
#define STRICT 1
#define THIS
#define TEXT(quote) L##quote
#define GetObject GetObjectA
#define NO_ERROR 0L
#define RELATIVE 2
#define ABSOLUTE 1

// Unreal
#define check(expression) \
    { (void)(expression); }
#define verify(expression) \
    { (void)(expression); }
#define ensure(expression) (expression)
#define PI (3.1415926535897932)

// Qt
#define slots
#define signals public
#define emit
#define foreach Q_FOREACH
#define forever for (;;)

// Xlib
#define None 0L
#define True 1
#define False 0
#define Bool int
#define Status int
#define Always 2
#define Success 0
#define Complex 0
#define Convex 2
#define Unsorted 0

// Arduino, and old C libraries; not abs() and round(), which no header of the standard library survives
#define sq(x) ((x) * (x))
#define constrain(x, low, high) ((x) < (low) ? (low) : ((x) > (high) ? (high) : (x)))
#define major(device) 0
#define minor(device) 0
#define unix 1
#define linux 1

// A program's own
#undef assert
#define assert(condition, ...) static_cast<void>(0)
#define LOG(...) static_cast<void>(0)
#define CHECK(...) static_cast<void>(0)
#define DEBUG 1
#define EPSILON 1e-6
