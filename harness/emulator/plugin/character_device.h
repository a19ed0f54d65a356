// By the clock on the wall a USART's bytes come from, and go to, the character device that QEMU was given for it.
// QEMU's own model of the USART, hidden behind ours, is the way there.
#pragma once

#include <cstdint>
#include <string>

#include "harness/emulator/plugin/usart.h"

namespace tiltproof::qemu {

class CharacterDevice {
 public:
  // `number`: 1 to UsartUnit::kCount. False when the machine has none.
  bool Init(int number, UsartUnit& usart) {
    usart_ = &usart;
    // At any place in the tree of devices.
    void* device = object_resolve_path(("usart[" + std::to_string(number - 1) + "]").c_str(), nullptr);
    if (device == nullptr) return false;
    model_ = sysbus_mmio_get_region(device, 0);
    const auto on_interrupt = [](void* self, int /*line*/, int level) {
      if (level != 0) static_cast<CharacterDevice*>(self)->Take();
    };
    qdev_connect_gpio_out_named(device, "sysbus-irq", 0, qemu_allocate_irq(on_interrupt, this, 0));
    return true;
  }

  void Transmit(std::uint8_t byte) { Write(kData, byte); }

  // The USART has been switched on or off: its model receives, with its interrupt, while it does.
  void Program() {
    Write(kControl1, kEnable | kTransmitterOn | (usart_->Receives() ? kReceiverOn | kNotEmpty : 0));
  }

  // Takes a byte over, if there is one and there is room.
  void Take() {
    if (!usart_->Free() || (Read(kStatus) & kNotEmpty) == 0) return;
    usart_->Deliver(static_cast<std::uint8_t>(Read(kData)), 0);
  }

 private:
  static constexpr std::uint64_t kStatus = 0x0, kData = 0x4, kControl1 = 0xC;
  static constexpr std::uint32_t kReceiverOn = 1u << 2, kTransmitterOn = 1u << 3, kNotEmpty = 1u << 5,
                                 kEnable = 1u << 13;

  std::uint32_t Read(std::uint64_t offset) {
    std::uint64_t value = 0;
    memory_region_dispatch_read(model_, offset, &value, kMemOp32LittleEndian, 0);
    return static_cast<std::uint32_t>(value);
  }
  void Write(std::uint64_t offset, std::uint32_t value) {
    memory_region_dispatch_write(model_, offset, value, kMemOp32LittleEndian, 0);
  }

  UsartUnit* usart_ = nullptr;
  void* model_ = nullptr;
};

}  // namespace tiltproof::qemu
