//! The boards that QEMU has and the firmware runs on: a processor with an FPU, one without, and one of another family.

/// A processor, and what stands for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Board {
    /// The processor's name.
    pub processor: &'static str,
    /// What Rust calls it.
    pub target: &'static str,
    /// QEMU's program.
    pub emulator: &'static str,
    /// QEMU's machine, and what else it must know about it.
    machine: &'static [&'static str],
    /// Programs that need more memory than that machine has, and the larger one that runs the same instructions.
    larger: Option<(&'static [&'static str], &'static [&'static str])>,
    /// How its registers are shown.
    pub registers: Registers,
}

/// How the emulator shows registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Registers {
    /// `R13=`, `R14=` and `R15=` in a line that begins with `R12=`.
    Arm,
    /// `pc` in a line of its own, later `x1/ra` and `x2/sp` in the line that begins with `x0/zero`.
    RiscV,
}

/// All boards.
pub const BOARDS: [Board; 3] = [
    // The board MPS2 with the image AN386.
    Board {
        processor: "Cortex-M4F",
        target: "thumbv7em-none-eabihf",
        emulator: "qemu-system-arm",
        machine: &["-M", "mps2-an386"],
        larger: None,
        registers: Registers::Arm,
    },
    // The BBC micro:bit has 256 KiB of flash memory and 16 KiB of RAM. 60 kB of parameters do not fit: the Cortex-M3 of
    // the image AN385 runs the same instructions.
    Board {
        processor: "Cortex-M0",
        target: "thumbv6m-none-eabi",
        emulator: "qemu-system-arm",
        machine: &["-M", "microbit"],
        larger: Some((&["attention", "embeddings"], &["-M", "mps2-an385"])),
        registers: Registers::Arm,
    },
    // The processor has what the target promises and no more: an instruction of an FPU would be noticed.
    Board {
        processor: "RV32IMC",
        target: "riscv32imc-unknown-none-elf",
        emulator: "qemu-system-riscv32",
        machine: &["-M", "virt", "-bios", "none", "-cpu", "rv32i,m=true,c=true,zicsr=true"],
        larger: None,
        registers: Registers::RiscV,
    },
];

impl Board {
    /// The machine for a program.
    pub fn machine(&self, program: &str) -> &'static [&'static str] {
        match self.larger {
            Some((programs, machine)) if programs.contains(&program) => machine,
            _ => self.machine,
        }
    }
}
