# CVODE for one target, from the sources in SUNDIALS_SOURCE: only the files that the integrator calls; it prints nothing
# and never contracts a * b + c, so that every platform rounds alike.

file(STRINGS ${SUNDIALS_SOURCE}/CMakeLists.txt version_lines REGEX "^set\\(PACKAGE_VERSION_(MAJOR|MINOR|PATCH|LABEL) ")
foreach(line IN LISTS version_lines)
  string(REGEX MATCH "(PACKAGE_VERSION_[A-Z]+) \"([^\"]*)\"" matched "${line}")
  set(${CMAKE_MATCH_1} "${CMAKE_MATCH_2}")
endforeach()
set(PACKAGE_VERSION ${PACKAGE_VERSION_MAJOR}.${PACKAGE_VERSION_MINOR}.${PACKAGE_VERSION_PATCH})
if(PACKAGE_VERSION VERSION_LESS 6.4 OR PACKAGE_VERSION VERSION_GREATER_EQUAL 8)
  message(FATAL_ERROR "${SUNDIALS_SOURCE} holds SUNDIALS ${PACKAGE_VERSION}, expected 6.4 up to and including 7.x")
endif()

# what the project's own configuration finds out or offers
set(PRECISION_LEVEL "#define SUNDIALS_DOUBLE_PRECISION 1")
set(INDEX_TYPE "#define SUNDIALS_INT64_T 1")
set(SUNDIALS_CINDEX_TYPE int64_t)
set(SUNDIALS_COUNTER_TYPE "long int")
set(SUNDIALS_LOGGING_LEVEL 0)
set(SUNDIALS_DEPRECATED_MSG_MACRO "__attribute__ ((__deprecated__(msg)))")
foreach(feature MATH_PRECISIONS ISINF_ISNAN INLINE SNPRINTF_AND_VA_COPY)
  set(SUNDIALS_C_COMPILER_HAS_${feature} TRUE)
endforeach()
set(sundials_headers ${CMAKE_CURRENT_BINARY_DIR}/sundials)
configure_file(${SUNDIALS_SOURCE}/include/sundials/sundials_config.in ${sundials_headers}/sundials/sundials_config.h)

add_library(sundials STATIC)
file(GLOB sundials_sources ${SUNDIALS_SOURCE}/src/sundials/*.c)
list(FILTER sundials_sources INCLUDE REGEX
  "/sundials_(band|context|dense|direct|errors|hashmap|iterative|linearsolver|logger|math|matrix|memory)\\.c$|\
/sundials_(nonlinearsolver|nvector|nvector_senswrapper|stepper|version)\\.c$")
list(APPEND sundials_sources
  ${SUNDIALS_SOURCE}/src/nvector/serial/nvector_serial.c
  ${SUNDIALS_SOURCE}/src/sunmatrix/band/sunmatrix_band.c
  ${SUNDIALS_SOURCE}/src/sunmatrix/dense/sunmatrix_dense.c
  ${SUNDIALS_SOURCE}/src/sunnonlinsol/newton/sunnonlinsol_newton.c)
foreach(part cvode cvode_io cvode_ls cvode_nls cvode_proj)
  list(APPEND sundials_sources ${SUNDIALS_SOURCE}/src/cvode/${part}.c)
endforeach()
if(EXISTS ${SUNDIALS_SOURCE}/src/cvode/cvode_resize.c)
  list(APPEND sundials_sources ${SUNDIALS_SOURCE}/src/cvode/cvode_resize.c)
endif()
target_sources(sundials PRIVATE ${sundials_sources})
set_target_properties(sundials PROPERTIES POSITION_INDEPENDENT_CODE ON C_VISIBILITY_PRESET hidden)
target_include_directories(sundials SYSTEM
  PUBLIC ${sundials_headers} ${SUNDIALS_SOURCE}/include PRIVATE ${SUNDIALS_SOURCE}/src/sundials)
target_compile_definitions(sundials PUBLIC SUNDIALS_STATIC_DEFINE)
target_compile_options(sundials PRIVATE -ffp-contract=off -ffunction-sections -w)
include(GenerateExportHeader)
generate_export_header(sundials BASE_NAME SUNDIALS EXPORT_FILE_NAME ${sundials_headers}/sundials/sundials_export.h)

# find_package(SUNDIALS) finds these targets
foreach(part cvode nvecserial generic)
  add_library(SUNDIALS::${part}_static ALIAS sundials)
endforeach()
file(WRITE ${CMAKE_FIND_PACKAGE_REDIRECTS_DIR}/sundials-config.cmake "")
write_basic_package_version_file(${CMAKE_FIND_PACKAGE_REDIRECTS_DIR}/sundials-config-version.cmake
  VERSION ${PACKAGE_VERSION} COMPATIBILITY AnyNewerVersion ARCH_INDEPENDENT)
