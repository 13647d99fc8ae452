//! A program as the linker wrote it: how large it is, and which function is where.

use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SymbolKind};
use std::path::Path;

/// Sizes and functions of a program.
pub struct Image {
    /// Name and length in bytes of every section that takes room in the flash memory, in the order of their addresses.
    pub sections: Vec<(String, u64)>,
    /// The functions by address.
    pub functions: Vec<Function>,
}

/// A function in the flash memory.
pub struct Function {
    /// Its name, mangled.
    pub name: String,
    /// Where it begins.
    pub address: u32,
    /// How many bytes it has, the constants between its instructions included.
    pub size: u32,
}

impl Image {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// If it is not one.
    pub fn open(path: &Path) -> Result<Image, String> {
        let failed = |error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
        let data = std::fs::read(path).map_err(|error| failed(&error))?;
        let file = object::File::parse(&*data).map_err(|error| failed(&error))?;
        let in_flash = |section: &object::Section| {
            let SectionFlags::Elf { sh_flags, .. } = section.flags() else { return false };
            // Without a file range it is memory that is only cleared.
            (sh_flags & object::elf::SHF_ALLOC).0 != 0 && section.file_range().is_some() && section.size() > 0
        };
        let mut sections: Vec<_> = file.sections().filter(in_flash).collect();
        sections.sort_by_key(ObjectSection::address);
        let sections = sections.iter().map(|section| {
            let name = section.name().map_err(|error| failed(&error))?;
            Ok((name.to_owned(), section.size()))
        });
        let mut functions = Vec::new();
        for symbol in file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0) {
            let name = symbol.name().map_err(|error| failed(&error))?.to_owned();
            // The lowest bit says that the instructions are Thumb's.
            functions.push(Function { name, address: symbol.address() as u32 & !1, size: symbol.size() as u32 });
        }
        functions.sort_by_key(|function| function.address);
        // Several names of one address are one function.
        functions.dedup_by_key(|function| function.address);
        Ok(Image { sections: sections.collect::<Result<_, String>>()?, functions })
    }

    /// Bytes of code and constants: everything that must be in the flash memory, the vector table included.
    pub fn bytes(&self) -> u64 {
        self.sections.iter().map(|(_, size)| size).sum()
    }

    /// Index of the function that an address lies in.
    pub fn function_at(&self, address: u32) -> Option<usize> {
        let after = self.functions.partition_point(|function| function.address <= address);
        let index = after.checked_sub(1)?;
        let function = &self.functions[index];
        (address - function.address < function.size).then_some(index)
    }
}
