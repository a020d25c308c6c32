//! The differences between the processors: where a program begins, and how its instructions are counted.
//!
//! QEMU with `-icount shift=0` lets a nanosecond of its clock pass in each instruction.

#[cfg(target_arch = "arm")]
pub use arm::Counter;
#[cfg(target_arch = "riscv32")]
pub use risc_v::Counter;

#[cfg(target_arch = "arm")]
mod arm {
    use cortex_m::peripheral::SYST;
    use cortex_m::peripheral::syst::SystClkSource;

    /// The boards count SysTick down at 25 MHz: 40 instructions a tick.
    const PER_TICK: u32 = 40;
    const MASK: u32 = 0x00ff_ffff;

    /// Counts instructions, to 40.
    pub struct Counter(SYST);

    impl Counter {
        pub fn start() -> Option<Self> {
            let mut clock = cortex_m::Peripherals::take()?.SYST;
            clock.set_clock_source(SystClkSource::Core);
            clock.set_reload(MASK);
            clock.clear_current();
            clock.enable_counter();
            Some(Self(clock))
        }

        pub fn now(&self) -> u32 {
            MASK - SYST::get_current()
        }

        /// The instructions since `before`, below 600 million.
        pub fn since(&self, before: u32) -> u32 {
            (self.now().wrapping_sub(before) & MASK) * PER_TICK
        }
    }

    #[cortex_m_rt::entry]
    fn begin() -> ! {
        crate::begin()
    }
}

#[cfg(target_arch = "riscv32")]
mod risc_v {
    use riscv::register::minstret;

    /// Counts instructions.
    pub struct Counter;

    impl Counter {
        pub fn start() -> Option<Self> {
            Some(Self)
        }

        pub fn now(&self) -> u32 {
            minstret::read() as u32
        }

        pub fn since(&self, before: u32) -> u32 {
            self.now().wrapping_sub(before)
        }
    }

    #[riscv_rt::entry]
    fn begin() -> ! {
        crate::begin()
    }
}
