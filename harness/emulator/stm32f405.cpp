#include "harness/emulator/stm32f405.h"

#include <fmt/format.h>

#include <array>
#include <span>

namespace tiltproof::harness {
namespace {

struct Register {
  std::uint16_t offset;
  std::string_view name;
};

// RM0090: 7.3.24, 5.4.3, 3.9.11, 30.6.8, 18.4.21, 8.4.11, 27.6.11, 28.5.10, 13.13.18, 12.3.7, 21.4.5, 24.4.5.
constexpr std::array kRcc = {
    Register{0x00, "CR"},        Register{0x04, "PLLCFGR"},   Register{0x08, "CFGR"},
    Register{0x0C, "CIR"},       Register{0x10, "AHB1RSTR"},  Register{0x14, "AHB2RSTR"},
    Register{0x18, "AHB3RSTR"},  Register{0x20, "APB1RSTR"},  Register{0x24, "APB2RSTR"},
    Register{0x30, "AHB1ENR"},   Register{0x34, "AHB2ENR"},   Register{0x38, "AHB3ENR"},
    Register{0x40, "APB1ENR"},   Register{0x44, "APB2ENR"},   Register{0x50, "AHB1LPENR"},
    Register{0x54, "AHB2LPENR"}, Register{0x58, "AHB3LPENR"}, Register{0x60, "APB1LPENR"},
    Register{0x64, "APB2LPENR"}, Register{0x70, "BDCR"},      Register{0x74, "CSR"},
    Register{0x80, "SSCGR"},     Register{0x84, "PLLI2SCFGR"}};
constexpr std::array kPwr = {Register{0x0, "CR"}, Register{0x4, "CSR"}};
constexpr std::array kFlashInterface = {Register{0x00, "ACR"},     Register{0x04, "KEYR"},
                                        Register{0x08, "OPTKEYR"}, Register{0x0C, "SR"},
                                        Register{0x10, "CR"},      Register{0x14, "OPTCR"}};
constexpr std::array kUsart = {Register{0x00, "SR"},  Register{0x04, "DR"},  Register{0x08, "BRR"},
                               Register{0x0C, "CR1"}, Register{0x10, "CR2"}, Register{0x14, "CR3"},
                               Register{0x18, "GTPR"}};
constexpr std::array kTimer = {Register{0x00, "CR1"},   Register{0x04, "CR2"},   Register{0x08, "SMCR"},
                               Register{0x0C, "DIER"},  Register{0x10, "SR"},    Register{0x14, "EGR"},
                               Register{0x18, "CCMR1"}, Register{0x1C, "CCMR2"}, Register{0x20, "CCER"},
                               Register{0x24, "CNT"},   Register{0x28, "PSC"},   Register{0x2C, "ARR"},
                               Register{0x30, "RCR"},   Register{0x34, "CCR1"},  Register{0x38, "CCR2"},
                               Register{0x3C, "CCR3"},  Register{0x40, "CCR4"},  Register{0x44, "BDTR"},
                               Register{0x48, "DCR"},   Register{0x4C, "DMAR"},  Register{0x50, "OR"}};
constexpr std::array kGpio = {Register{0x00, "MODER"}, Register{0x04, "OTYPER"}, Register{0x08, "OSPEEDR"},
                              Register{0x0C, "PUPDR"}, Register{0x10, "IDR"},    Register{0x14, "ODR"},
                              Register{0x18, "BSRR"},  Register{0x1C, "LCKR"},   Register{0x20, "AFRL"},
                              Register{0x24, "AFRH"}};
constexpr std::array kI2c = {Register{0x00, "CR1"},  Register{0x04, "CR2"}, Register{0x08, "OAR1"},
                             Register{0x0C, "OAR2"}, Register{0x10, "DR"},  Register{0x14, "SR1"},
                             Register{0x18, "SR2"},  Register{0x1C, "CCR"}, Register{0x20, "TRISE"}};
constexpr std::array kSpi = {Register{0x00, "CR1"},    Register{0x04, "CR2"},     Register{0x08, "SR"},
                             Register{0x0C, "DR"},     Register{0x10, "CRCPR"},   Register{0x14, "RXCRCR"},
                             Register{0x18, "TXCRCR"}, Register{0x1C, "I2SCFGR"}, Register{0x20, "I2SPR"}};
constexpr std::array kAdc = {Register{0x00, "SR"},    Register{0x04, "CR1"},   Register{0x08, "CR2"},
                             Register{0x0C, "SMPR1"}, Register{0x10, "SMPR2"}, Register{0x2C, "SQR1"},
                             Register{0x30, "SQR2"},  Register{0x34, "SQR3"},  Register{0x4C, "DR"}};
constexpr std::array kExti = {Register{0x00, "IMR"},  Register{0x04, "EMR"},   Register{0x08, "RTSR"},
                              Register{0x0C, "FTSR"}, Register{0x10, "SWIER"}, Register{0x14, "PR"}};
constexpr std::array kWatchdog = {Register{0x0, "KR"}, Register{0x4, "PR"}, Register{0x8, "RLR"},
                                  Register{0xC, "SR"}};
constexpr std::array kRandom = {Register{0x0, "CR"}, Register{0x4, "SR"}, Register{0x8, "DR"}};
// PM0214: 4.5, 4.4, 4.2; ARMv7-M ARM, table C1-21; RM0090, 38.16.
constexpr std::array kSysTick = {Register{0x0, "CTRL"}, Register{0x4, "LOAD"}, Register{0x8, "VAL"},
                                 Register{0xC, "CALIB"}};
constexpr std::array kSystemControl = {
    Register{0x00, "CPUID"}, Register{0x04, "ICSR"},  Register{0x08, "VTOR"},  Register{0x0C, "AIRCR"},
    Register{0x10, "SCR"},   Register{0x14, "CCR"},   Register{0x18, "SHPR1"}, Register{0x1C, "SHPR2"},
    Register{0x20, "SHPR3"}, Register{0x24, "SHCSR"}, Register{0x28, "CFSR"},  Register{0x2C, "HFSR"},
    Register{0x30, "DFSR"},  Register{0x34, "MMFAR"}, Register{0x38, "BFAR"},  Register{0x3C, "AFSR"},
    Register{0x88, "CPACR"}};
constexpr std::array kMpu = {Register{0x00, "TYPE"}, Register{0x04, "CTRL"}, Register{0x08, "RNR"},
                             Register{0x0C, "RBAR"}, Register{0x10, "RASR"}};
constexpr std::array kTrace = {Register{0x0, "CTRL"}, Register{0x4, "CYCCNT"}};
constexpr std::array kDebug = {Register{0x0, "IDCODE"}, Register{0x4, "CR"}, Register{0x8, "APB1_FZ"},
                               Register{0xC, "APB2_FZ"}};

struct Block {
  Peripheral peripheral;
  std::span<const Register> registers;
};

constexpr std::uint32_t kUsual = 0x400;
constexpr Emulated kYes = Emulated::kYes, kZero = Emulated::kReadsZero, kNo = Emulated::kNo;
constexpr bool kOtherChip = false;

// RM0090, table 1, and the private peripheral bus (PM0214, table 37). What is emulated: hw/arm/stm32f405_soc.c
// of QEMU 7.2, and harness/emulator/plugin.
constexpr auto kBlocks = std::to_array<Block>({
    {{"TIM2", 0x4000'0000, kUsual, kYes}, kTimer},
    {{"TIM3", 0x4000'0400, kUsual, kYes}, kTimer},
    {{"TIM4", 0x4000'0800, kUsual, kYes}, kTimer},
    {{"TIM5", 0x4000'0C00, kUsual, kYes}, kTimer},
    {{"TIM6", 0x4000'1000, kUsual, kYes}, kTimer},
    {{"TIM7", 0x4000'1400, kUsual, kYes}, kTimer},
    {{"TIM12", 0x4000'1800, kUsual, kYes}, kTimer},
    {{"TIM13", 0x4000'1C00, kUsual, kYes}, kTimer},
    {{"TIM14", 0x4000'2000, kUsual, kYes}, kTimer},
    {{"RTC", 0x4000'2800, kUsual, kZero}, {}},
    {{"WWDG", 0x4000'2C00, kUsual, kZero}, {}},
    {{"IWDG", 0x4000'3000, kUsual, kYes}, kWatchdog},
    {{"I2S2ext", 0x4000'3400, kUsual, kZero}, kSpi},
    {{"SPI2", 0x4000'3800, kUsual, kYes}, kSpi},
    {{"SPI3", 0x4000'3C00, kUsual, kYes}, kSpi},
    {{"I2S3ext", 0x4000'4000, kUsual, kZero}, kSpi},
    {{"USART2", 0x4000'4400, kUsual, kYes}, kUsart},
    {{"USART3", 0x4000'4800, kUsual, kYes}, kUsart},
    {{"UART4", 0x4000'4C00, kUsual, kYes}, kUsart},
    {{"UART5", 0x4000'5000, kUsual, kYes}, kUsart},
    {{"I2C1", 0x4000'5400, kUsual, kZero}, kI2c},
    {{"I2C2", 0x4000'5800, kUsual, kZero}, kI2c},
    {{"I2C3", 0x4000'5C00, kUsual, kZero}, kI2c},
    {{"CAN1", 0x4000'6400, kUsual, kZero}, {}},
    {{"CAN2", 0x4000'6800, kUsual, kZero}, {}},
    {{"PWR", 0x4000'7000, kUsual, kYes}, kPwr},
    {{"DAC", 0x4000'7400, kUsual, kZero}, {}},
    {{"UART7", 0x4000'7800, kUsual, kYes, kOtherChip}, kUsart},
    {{"UART8", 0x4000'7C00, kUsual, kNo, kOtherChip}, kUsart},
    {{"TIM1", 0x4001'0000, kUsual, kYes}, kTimer},
    {{"TIM8", 0x4001'0400, kUsual, kYes}, kTimer},
    {{"USART1", 0x4001'1000, kUsual, kYes}, kUsart},
    {{"USART6", 0x4001'1400, kUsual, kYes}, kUsart},
    {{"ADC1", 0x4001'2000, 0x100, kYes}, kAdc},
    {{"ADC2", 0x4001'2100, 0x100, kYes}, kAdc},
    {{"ADC3", 0x4001'2200, 0x100, kYes}, kAdc},
    {{"SDIO", 0x4001'2C00, kUsual, kZero}, {}},
    {{"SPI1", 0x4001'3000, kUsual, kYes}, kSpi},
    {{"SPI4", 0x4001'3400, kUsual, kYes, kOtherChip}, kSpi},
    {{"SYSCFG", 0x4001'3800, kUsual, kYes}, {}},
    {{"EXTI", 0x4001'3C00, kUsual, kYes}, kExti},
    {{"TIM9", 0x4001'4000, kUsual, kYes}, kTimer},
    {{"TIM10", 0x4001'4400, kUsual, kYes}, kTimer},
    {{"TIM11", 0x4001'4800, kUsual, kYes}, kTimer},
    {{"SPI5", 0x4001'5000, kUsual, kYes, kOtherChip}, kSpi},
    {{"SPI6", 0x4001'5400, kUsual, kYes, kOtherChip}, kSpi},
    {{"SAI1", 0x4001'5800, kUsual, kNo, kOtherChip}, {}},
    {{"LTDC", 0x4001'6800, kUsual, kNo, kOtherChip}, {}},
    {{"GPIOA", 0x4002'0000, kUsual, kYes}, kGpio},
    {{"GPIOB", 0x4002'0400, kUsual, kYes}, kGpio},
    {{"GPIOC", 0x4002'0800, kUsual, kYes}, kGpio},
    {{"GPIOD", 0x4002'0C00, kUsual, kYes}, kGpio},
    {{"GPIOE", 0x4002'1000, kUsual, kYes}, kGpio},
    {{"GPIOF", 0x4002'1400, kUsual, kYes}, kGpio},
    {{"GPIOG", 0x4002'1800, kUsual, kYes}, kGpio},
    {{"GPIOH", 0x4002'1C00, kUsual, kYes}, kGpio},
    {{"GPIOI", 0x4002'2000, kUsual, kYes}, kGpio},
    {{"GPIOJ", 0x4002'2400, kUsual, kNo, kOtherChip}, kGpio},
    {{"GPIOK", 0x4002'2800, kUsual, kNo, kOtherChip}, kGpio},
    {{"CRC", 0x4002'3000, kUsual, kZero}, {}},
    {{"RCC", 0x4002'3800, kUsual, kYes}, kRcc},
    {{"FLASH", 0x4002'3C00, kUsual, kYes}, kFlashInterface},
    {{"BKPSRAM", 0x4002'4000, 0x1000, kZero}, {}},
    {{"DMA1", 0x4002'6000, kUsual, kYes}, {}},
    {{"DMA2", 0x4002'6400, kUsual, kYes}, {}},
    {{"ETH", 0x4002'8000, 0x1400, kZero, kOtherChip}, {}},
    {{"DMA2D", 0x4002'B000, 0xC00, kNo, kOtherChip}, {}},
    {{"USB_OTG_HS", 0x4004'0000, 0x4'0000, kZero}, {}},
    {{"USB_OTG_FS", 0x5000'0000, 0x4'0000, kZero}, {}},
    {{"DCMI", 0x5005'0000, kUsual, kZero, kOtherChip}, {}},
    {{"CRYP", 0x5006'0000, kUsual, kNo, kOtherChip}, {}},
    {{"HASH", 0x5006'0400, kUsual, kNo, kOtherChip}, {}},
    {{"RNG", 0x5006'0800, kUsual, kZero}, kRandom},
    {{"FSMC", 0xA000'0000, 0x1000, kNo}, {}},
    {{"ITM", 0xE000'0000, 0x1000, kZero}, {}},
    {{"DWT", 0xE000'1000, 0x1000, kYes}, kTrace},
    {{"FPB", 0xE000'2000, 0x1000, kZero}, {}},
    {{"SYSTICK", 0xE000'E010, 0x10, kYes}, kSysTick},
    {{"NVIC", 0xE000'E100, 0xC00, kYes}, {}},
    {{"SCB", 0xE000'ED00, 0x90, kYes}, kSystemControl},
    {{"MPU", 0xE000'ED90, 0x60, kYes}, kMpu},
    {{"FPU", 0xE000'EF30, 0x20, kYes}, {}},
    {{"TPIU", 0xE004'0000, 0x1000, kZero}, {}},
    {{"ETM", 0xE004'1000, 0x1000, kZero}, {}},
    {{"DBGMCU", 0xE004'2000, 0x1000, kYes}, kDebug},
});

const Block* FindBlock(std::uint32_t address) {
  for (const Block& block : kBlocks)
    if (address - block.peripheral.address < block.peripheral.size_bytes) return &block;
  return nullptr;
}

// DMA1 and DMA2 (RM0090, section 10.5.11): flags, then six registers for each of eight streams.
std::string DmaRegister(std::uint32_t offset) {
  constexpr std::array kFlagRegisters = {"LISR", "HISR", "LIFCR", "HIFCR"};
  constexpr std::array kOfStream = {"CR", "NDTR", "PAR", "M0AR", "M1AR", "FCR"};
  constexpr std::uint32_t kStreams = 0x10, kStreamBytes = 4 * kOfStream.size(), kStreamCount = 8;
  if (offset < kStreams) return kFlagRegisters[offset / 4];
  const std::uint32_t stream = (offset - kStreams) / kStreamBytes;
  if (stream >= kStreamCount) return {};
  return fmt::format("S{}{}", stream, kOfStream[(offset - kStreams) % kStreamBytes / 4]);
}

}  // namespace

const Peripheral* FindPeripheral(std::uint32_t address) {
  const Block* block = FindBlock(address);
  return block == nullptr ? nullptr : &block->peripheral;
}

Emulated EmulationOf(std::uint32_t address) {
  const Block* block = FindBlock(address);
  return block == nullptr ? Emulated::kNo : block->peripheral.emulated;
}

std::string RegisterName(std::uint32_t address) {
  const Block* block = FindBlock(address);
  if (block == nullptr) return {};
  const std::string name(block->peripheral.name);
  const std::uint32_t offset = address - block->peripheral.address;
  if (name.starts_with("DMA") && name.size() == 4) {
    const std::string of_dma = DmaRegister(offset);
    if (!of_dma.empty()) return name + "_" + of_dma;
  }
  // Bytes and half-words of a register belong to it.
  for (const Register& known : block->registers)
    if (known.offset == (offset & ~3U)) return name + "_" + std::string(known.name);
  return fmt::format("{} + 0x{:x}", name, offset);
}

std::string PlaceName(std::uint32_t address) {
  if (Holds(kFlash, address) || Holds(kFlashAtZero, address)) return "flash";
  if (Holds(kRam, address)) return "RAM";
  if (Holds(kCoreCoupledRam, address)) return "core-coupled RAM";
  const std::string name = RegisterName(address);
  return name.empty() ? "no memory" : name;
}

}  // namespace tiltproof::harness
