# The FMU of the paper's example, made anew whenever the library, the description or any packed file changes, and the
# files from which an installed package makes FMUs of other games.

set(packaging ${PROJECT_SOURCE_DIR}/python_harness/mixed_order_game/fmu/packaging.py)
set(game ${PROJECT_SOURCE_DIR}/modelDescription/games/five_vehicles.toml)
set(documentation ${PROJECT_SOURCE_DIR}/modelDescription/documentation)
set(icon ${PROJECT_SOURCE_DIR}/modelDescription/model.png)
set(description ${PROJECT_BINARY_DIR}/fmu/modelDescription.xml)
set(extra ${PROJECT_BINARY_DIR}/fmu/extra)
set(archive ${PROJECT_BINARY_DIR}/fmu/MixedOrderGame.fmu)

# Name of this platform, and the folders in which importers look for its library: FMI 2.0 names none for Arm.
if(APPLE)
  set(platform darwin64)
elseif(WIN32)
  set(platform win64)
elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
  set(platform aarch64-linux)
else()
  set(platform linux64)
endif()
set(binaries --binary ${platform}=$<TARGET_FILE:MixedOrderGame>)
if(platform STREQUAL "aarch64-linux")
  list(APPEND binaries --binary linux64=$<TARGET_FILE:MixedOrderGame>)
endif()

# Licences of everything that is linked into the binary.
set(licenses ${PROJECT_BINARY_DIR}/licenses)
file(MAKE_DIRECTORY ${licenses})
configure_file(${PROJECT_SOURCE_DIR}/LICENSE ${licenses}/mixed-order-game.txt COPYONLY)
function(collect_license name)
  foreach(candidate IN LISTS ARGN)
    if(EXISTS "${candidate}")
      configure_file("${candidate}" ${licenses}/${name}.txt COPYONLY)
      return()
    endif()
  endforeach()
  message(WARNING "no licence text found for ${name}: the FMU will lack documentation/licenses/${name}.txt")
endfunction()
collect_license(sundials /usr/share/doc/libsundials-dev/copyright "${sundials_SOURCE_DIR}/LICENSE")
collect_license(eigen /usr/share/doc/libeigen3-dev/copyright "${eigen_SOURCE_DIR}/COPYING.MPL2")
collect_license(pegtl /usr/share/doc/tao-pegtl-dev/copyright "${pegtl_SOURCE_DIR}/LICENSE")
collect_license(tomlplusplus /usr/share/doc/libtomlplusplus-dev/copyright "${tomlplusplus_SOURCE_DIR}/LICENSE")
collect_license(pugixml /usr/share/doc/libpugixml-dev/copyright "${pugixml_SOURCE_DIR}/LICENSE.md")  # in the host tool
string(REGEX MATCH "^[0-9]+" gcc_version "${CMAKE_CXX_COMPILER_VERSION}")
collect_license(libstdc++ /usr/share/doc/libstdc++-${gcc_version}-dev/copyright
                /usr/share/doc/gcc-${gcc_version}-base/copyright)

file(GLOB_RECURSE packed CONFIGURE_DEPENDS ${documentation}/* ${licenses}/*)
add_custom_command(
  OUTPUT ${description}
  COMMAND ${CMAKE_COMMAND} -E make_directory ${extra}
  COMMAND mixed-order-game-description ${game} --output ${description} --extra ${extra}
  DEPENDS mixed-order-game-description ${game}
  VERBATIM)
add_custom_command(
  OUTPUT ${archive}
  COMMAND ${Python_EXECUTABLE} ${packaging} --model-description ${description} --game ${game}
          ${binaries} --documentation ${documentation} --licenses ${licenses} --icon ${icon} --extra ${extra}
          --output ${archive}
  DEPENDS MixedOrderGame ${description} ${game} ${packaging} ${packed} ${icon}
  VERBATIM)
add_custom_target(fmu ALL DEPENDS ${archive})

install(TARGETS MixedOrderGame LIBRARY DESTINATION mixed_order_game/_native/binaries/${platform})
install(TARGETS mixed-order-game-description RUNTIME DESTINATION mixed_order_game/_native/tools/${platform})
install(DIRECTORY ${documentation}/ DESTINATION mixed_order_game/_native/documentation)
install(DIRECTORY ${licenses}/ DESTINATION mixed_order_game/_native/licenses)
install(FILES ${icon} DESTINATION mixed_order_game/_native)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/modelDescription/games/ DESTINATION mixed_order_game/games)
