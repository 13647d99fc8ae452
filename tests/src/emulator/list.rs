//! Lists of named numbers, compared bit by bit.

/// A name and the bits of a number.
pub type Line = (String, u32);

/// Where and how two lists differ.
#[derive(Clone, Debug, PartialEq)]
pub enum Difference {
    /// There is nothing to compare, or next to nothing: so many different numbers.
    Poor(usize),
    /// A number that is not finite: its bits are not a result.
    NotFinite(usize, Line),
    /// So many lines instead of so many.
    Length(usize, usize),
    /// This line instead of that.
    Line(usize, Line, Line),
}

/// The list that a function emits.
pub fn gathered(list: impl FnOnce(&mut dyn FnMut(&str, f32))) -> Vec<Line> {
    let mut lines = Vec::new();
    list(&mut |name, value| lines.push((name.to_owned(), value.to_bits())));
    lines
}

/// The list that a program printed: a line is eight hexadecimal digits, a space and a name.
///
/// # Errors
/// The line that is something else.
pub fn parsed(text: &str) -> Result<Vec<Line>, String> {
    let parse = |line: &str| {
        let (bits, name) = line.split_once(' ')?;
        (bits.len() == 8).then_some(())?;
        Some((name.to_owned(), u32::from_str_radix(bits, 16).ok()?))
    };
    text.lines().map(|line| parse(line).ok_or_else(|| line.to_owned())).collect()
}

/// Compares two lists, names and all.
///
/// # Errors
/// The first difference; also lists with fewer than `least` different numbers, and numbers that are not finite.
pub fn compare(actual: &[Line], expected: &[Line], least: usize) -> Result<(), Difference> {
    let mut different: Vec<u32> = expected.iter().map(|(_, bits)| *bits).collect();
    different.sort_unstable();
    different.dedup();
    if different.len() < least {
        return Err(Difference::Poor(different.len()));
    }
    if let Some(index) = expected.iter().position(|(_, bits)| !f32::from_bits(*bits).is_finite()) {
        return Err(Difference::NotFinite(index, expected[index].clone()));
    }
    if actual.len() != expected.len() {
        return Err(Difference::Length(actual.len(), expected.len()));
    }
    match actual.iter().zip(expected).position(|(actual, expected)| actual != expected) {
        Some(index) => Err(Difference::Line(index, actual[index].clone(), expected[index].clone())),
        None => Ok(()),
    }
}
