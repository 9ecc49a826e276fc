# Tool chain: the cross compiler of the ziglang package, for one target. ZIG_TARGET names it (x86_64-windows-gnu, ...)
# and ZIG_TOOLS is the folder of the commands cc, c++, ar, ranlib and rc, which build_all writes.

list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES ZIG_TARGET ZIG_TOOLS)
if(NOT ZIG_TARGET MATCHES "^(x86_64|aarch64)-(linux|windows|macos)")
  message(FATAL_ERROR "ZIG_TARGET is '${ZIG_TARGET}', expected a processor and a system such as x86_64-windows-gnu")
endif()
set(CMAKE_SYSTEM_PROCESSOR ${CMAKE_MATCH_1})
if(CMAKE_MATCH_2 STREQUAL "linux")
  set(CMAKE_SYSTEM_NAME Linux)
elseif(CMAKE_MATCH_2 STREQUAL "windows")
  set(CMAKE_SYSTEM_NAME Windows)
else()
  set(CMAKE_SYSTEM_NAME Darwin)
  # math.h includes float.h for NAN alone, and libc++'s guard then withholds the rest of it
  set(CMAKE_CXX_FLAGS_INIT "-include cfloat")
endif()

foreach(language C CXX)
  set(CMAKE_${language}_COMPILER_TARGET ${ZIG_TARGET})
endforeach()
set(CMAKE_C_COMPILER ${ZIG_TOOLS}/cc)
set(CMAKE_CXX_COMPILER ${ZIG_TOOLS}/c++)
set(CMAKE_RC_COMPILER ${ZIG_TOOLS}/rc)
foreach(kind EXE SHARED)
  set(CMAKE_${kind}_LINKER_FLAGS_INIT "-s")  # no debug information of the compiler's own libraries
endforeach()
foreach(language "" C_COMPILER_ CXX_COMPILER_)
  set(CMAKE_${language}AR ${ZIG_TOOLS}/ar)
  set(CMAKE_${language}RANLIB ${ZIG_TOOLS}/ranlib)
endforeach()
set(CMAKE_INSTALL_NAME_TOOL ${CMAKE_COMMAND})  # asked for, never called

# a trial link would build the C++ library of the target once more, without optimisation
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
# nothing of this machine's libraries and headers; packages of headers alone are named one by one
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
