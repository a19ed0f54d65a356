# Contents of `cmake --install` and the Debian package. The program finds everything from its own place (harness/client/
# firmware_files.h), so a prefix may be anywhere, and may be moved:
#   bin/tiltproof                 the program
#   lib/tiltproof                 what it loads: the firmware, the emulator's plug-in, the virtual clock, the images for the STM32F4
#   lib, include/tiltproof        the codec and the firmware for find_package(tiltproof)
#   lib/python3/dist-packages     the Python module
#   share/tiltproof               models, scenarios, examples, the interface of the bus
#   share/doc, man, completions   what is to be read
include(CMakePackageConfigHelpers)

set(share share/tiltproof)

install(TARGETS tiltproof RUNTIME DESTINATION bin)
install(TARGETS tiltproof_firmware tiltproof_lockstep minimal_firmware nmpc_firmware LIBRARY DESTINATION lib/tiltproof)
if(TARGET tiltproof_clock)
  install(TARGETS tiltproof_clock LIBRARY DESTINATION lib/tiltproof)
endif()
if(TARGET stm32f4_images)
  # The image `budgets`, and those in `planted` and `framed`, serve tests.
  install(DIRECTORY ${TILTPROOF_STM32F4_DIR}/ DESTINATION lib/tiltproof/stm32f4
    FILES_MATCHING PATTERN "*.elf" PATTERN CMakeFiles EXCLUDE PATTERN budgets.elf EXCLUDE PATTERN planted EXCLUDE PATTERN framed EXCLUDE)
endif()

install(DIRECTORY plant/models/ DESTINATION ${share}/models FILES_MATCHING PATTERN *.sdf PATTERN *.tiltproof.xml)
install(DIRECTORY scenarios/ DESTINATION ${share}/scenarios FILES_MATCHING PATTERN *.yaml PATTERN *.json PATTERN *.sdf PATTERN *.csv)
# Where Debian's Python looks.
install(DIRECTORY python/tiltproof DESTINATION lib/python3/dist-packages FILES_MATCHING PATTERN *.py PATTERN py.typed PATTERN __pycache__ EXCLUDE)
install(DIRECTORY firmware/examples/ DESTINATION ${share}/examples PATTERN __pycache__ EXCLUDE PATTERN minimal_c/CMakeLists.txt EXCLUDE PATTERN nmpc/CMakeLists.txt EXCLUDE PATTERN posix_c/CMakeLists.txt EXCLUDE)

install(FILES README.md ARCHITECTURE.md CHANGELOG.md THIRD_PARTY.md DESTINATION share/doc/tiltproof)
install(FILES LICENSE DESTINATION share/doc/tiltproof RENAME copyright)
install(DIRECTORY docs DESTINATION share/doc/tiltproof FILES_MATCHING PATTERN *.md PATTERN *.svg PATTERN github-actions.yml PATTERN annotate.py)
# The commands of an installed program are typed without the build folder. The package's scenarios have a place; another folder may
# be moved.
install(CODE [[
  file(GLOB pages "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}/share/doc/tiltproof/*.md" "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}/share/doc/tiltproof/docs/*.md")
  foreach(page ${pages})
    file(READ ${page} text)
    string(REPLACE "build/release/tiltproof" "tiltproof" text "${text}")
    if(CMAKE_INSTALL_PREFIX STREQUAL "/usr")
      string(REGEX REPLACE "(tiltproof [a-z-]+ )scenarios/" "\\1/usr/share/tiltproof/scenarios/" text "${text}")
      string(REPLACE "library:build/release/lib/" "library:/usr/lib/tiltproof/" text "${text}")
    endif()
    file(WRITE ${page} "${text}")
  endforeach()
]])
install(DIRECTORY ${TILTPROOF_MANUAL_DIR}/ DESTINATION share/man/man1 FILES_MATCHING PATTERN *.1)
# Debian's policy: pages are compressed, without the time of day.
install(CODE [[
  file(GLOB pages "$ENV{DESTDIR}${CMAKE_INSTALL_PREFIX}/share/man/man1/tiltproof*.1")
  if(pages)
    execute_process(COMMAND gzip -9nf ${pages} COMMAND_ERROR_IS_FATAL ANY)
  endif()
]])
install(FILES ${TILTPROOF_MANUAL_DIR}/tiltproof.bash DESTINATION share/bash-completion/completions RENAME tiltproof)
# Where Debian's zsh looks.
install(FILES ${TILTPROOF_MANUAL_DIR}/_tiltproof DESTINATION share/zsh/vendor-completions)

install(FILES cmake/tiltproof.lintian-overrides DESTINATION share/lintian/overrides RENAME tiltproof)

# find_package(tiltproof): tiltproof::link, tiltproof::firmware, tiltproof::firmware_client, tiltproof::tiltproof (the program).
add_library(firmware_client INTERFACE)
foreach(target link_codec firmware_core firmware_client)
  target_include_directories(${target} INTERFACE $<INSTALL_INTERFACE:include/tiltproof>)
endforeach()
target_compile_features(link_codec INTERFACE cxx_std_20)
set_target_properties(link_codec PROPERTIES EXPORT_NAME link OUTPUT_NAME tiltproof_link)
set_target_properties(firmware_core PROPERTIES EXPORT_NAME firmware OUTPUT_NAME tiltproof_firmware_core)
install(TARGETS link_codec firmware_core firmware_client EXPORT tiltproof_targets ARCHIVE DESTINATION lib)
install(TARGETS tiltproof EXPORT tiltproof_targets RUNTIME DESTINATION bin)
install(FILES link/frame.h link/fletcher16.h link/message_kind.h link/time.h DESTINATION include/tiltproof/link)
file(GLOB firmware_headers CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/firmware/*.h)
install(FILES ${firmware_headers} DESTINATION include/tiltproof/firmware)
file(GLOB tolerant_headers CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/firmware/tolerant/*.h)
install(FILES ${tolerant_headers} DESTINATION include/tiltproof/firmware/tolerant)

set(config_dir lib/cmake/tiltproof)
install(EXPORT tiltproof_targets NAMESPACE tiltproof:: DESTINATION ${config_dir} FILE tiltproof-targets.cmake)
configure_package_config_file(cmake/tiltproof-config.cmake.in ${PROJECT_BINARY_DIR}/tiltproof-config.cmake
  INSTALL_DESTINATION ${config_dir} PATH_VARS share NO_CHECK_REQUIRED_COMPONENTS_MACRO)
# 0.x promises nothing from one minor version to the next.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/tiltproof-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/tiltproof-config.cmake ${PROJECT_BINARY_DIR}/tiltproof-config-version.cmake
  DESTINATION ${config_dir})

# `cpack` in the build folder, or ./setup --deb.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME tiltproof)
# The package's maintainer: as Debian's tools ask it, otherwise the author of the commit that is packed.
execute_process(COMMAND git log -1 "--format=%an <%ae>" WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
  OUTPUT_VARIABLE author OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE no_author)
if(DEFINED ENV{DEBEMAIL})
  set(packager "$ENV{DEBFULLNAME}")
  if(packager STREQUAL "")
    set(packager "$ENV{DEBEMAIL}")
  endif()
  set(CPACK_PACKAGE_CONTACT "${packager} <$ENV{DEBEMAIL}>")
elseif(NOT no_author)
  set(CPACK_PACKAGE_CONTACT "${author}")
else()
  set(CPACK_PACKAGE_CONTACT "unknown packager (set DEBFULLNAME and DEBEMAIL) <root@localhost>")
endif()
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${PROJECT_DESCRIPTION}")
set(CPACK_PACKAGE_DESCRIPTION "Flies flight-control firmware against a simulated tilt-rotor over a
serial line that lies: faults in bytes, frames, sensors, actuators and the
device itself, scored with a margin, replayed to the bit. With firmware
images for the STM32F4, scenarios, and the codec as a library.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# Flies the images (--client qemu); tiltproof says so where it is missing.
set(CPACK_DEBIAN_PACKAGE_SUGGESTS qemu-system-arm)
# Runs the module; the program does without.
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS python3)
include(CPack)
