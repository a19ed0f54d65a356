# The firmware images for the STM32F4 (firmware/ports/stm32f4), built along with everything else where the cross compiler is
# installed. Output: ${PROJECT_BINARY_DIR}/firmware/stm32f4/*.elf
option(TILTPROOF_STM32F4 "Build the STM32F4 images (needs arm-none-eabi-g++)" ON)
if(NOT TILTPROOF_STM32F4 OR TILTPROOF_SANITIZE) # no sanitizer runs on the board
  return()
endif()

find_program(TILTPROOF_ARM_CXX arm-none-eabi-g++ DOC "Cross compiler of the STM32F4 images")
if(NOT TILTPROOF_ARM_CXX)
  message(STATUS "STM32F4 images: not built, there is no arm-none-eabi-g++ (./setup --images installs it)")
  return()
endif()
message(STATUS "STM32F4 images: executive-<firmware>[-provant|-hardened].elf")

# FreeRTOS is in no distribution. A checkout of the user's own, or the one that ./setup --freertos makes.
set(FREERTOS_KERNEL_PATH "$ENV{FREERTOS_KERNEL_PATH}" CACHE PATH "Checkout of FreeRTOS-Kernel, for the images with FreeRTOS")
set(freertos_kernel_path "${FREERTOS_KERNEL_PATH}")
if(NOT freertos_kernel_path)
  set(freertos_kernel_path "$ENV{FREERTOS_KERNEL_PATH}")
endif()
if(NOT freertos_kernel_path AND EXISTS ${PROJECT_SOURCE_DIR}/build/freertos-kernel)
  set(freertos_kernel_path ${PROJECT_SOURCE_DIR}/build/freertos-kernel)
endif()
if(freertos_kernel_path AND NOT EXISTS ${freertos_kernel_path}/tasks.c)
  message(FATAL_ERROR "FREERTOS_KERNEL_PATH=${freertos_kernel_path} is no checkout of FreeRTOS-Kernel: there is no tasks.c")
elseif(freertos_kernel_path)
  message(STATUS "STM32F4 images with FreeRTOS: freertos-<firmware>[-provant|-hardened].elf, from ${freertos_kernel_path}")
else()
  message(STATUS "STM32F4 images with FreeRTOS: not built, there is no kernel; ./setup --freertos fetches one, "
    "or set FREERTOS_KERNEL_PATH to a checkout of FreeRTOS-Kernel")
endif()

include(ExternalProject)
set(TILTPROOF_STM32F4_DIR ${PROJECT_BINARY_DIR}/firmware/stm32f4)
ExternalProject_Add(stm32f4_images
  SOURCE_DIR ${PROJECT_SOURCE_DIR}/firmware/ports/stm32f4
  BINARY_DIR ${TILTPROOF_STM32F4_DIR}
  PREFIX ${PROJECT_BINARY_DIR}/CMakeFiles/stm32f4_images
  CMAKE_ARGS --toolchain ${PROJECT_SOURCE_DIR}/cmake/arm-none-eabi.cmake "-DFREERTOS_KERNEL_PATH=${freertos_kernel_path}"
  BUILD_COMMAND ${CMAKE_COMMAND} --build <BINARY_DIR>
  BUILD_ALWAYS TRUE
  INSTALL_COMMAND ""
  EXCLUDE_FROM_ALL FALSE)
