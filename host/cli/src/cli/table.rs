//! Tables on the terminal. Few lines for what they need: the crates for tables take as long to compile as a whole
//! command.

use std::fmt;
use unicode_width::UnicodeWidthStr;

/// A table with a ruled header and no rules between rows.
pub(crate) struct Table {
    /// The header and the rows. Cells of the header may have several lines.
    rows: Vec<Vec<String>>,
    /// Columns that are aligned to the left; all others are to the right.
    left: Vec<usize>,
}

/// A table with this header; every column but the first is aligned to the right.
pub(crate) fn table(header: impl IntoIterator<Item = String>) -> Table {
    Table { rows: vec![header.into_iter().collect()], left: vec![0] }
}

impl Table {
    pub(crate) fn add_row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    pub(crate) fn align_left(&mut self, columns: impl IntoIterator<Item = usize>) {
        self.left.extend(columns);
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |cell: &String| cell.lines().map(UnicodeWidthStr::width).max().unwrap_or(0);
        let count = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let widths: Vec<usize> = (0..count)
            .map(|column| self.rows.iter().filter_map(|row| row.get(column)).map(width).max().unwrap_or(0))
            .collect();
        let rule = |kind: &str| kind.repeat(widths.iter().map(|width| width + 3).sum::<usize>().saturating_sub(1));
        writeln!(f, "{}", rule("\u{2500}"))?;
        for (index, row) in self.rows.iter().enumerate() {
            let height = row.iter().map(|cell| cell.lines().count()).max().unwrap_or(0);
            for line in 0..height {
                for (column, width) in widths.iter().enumerate() {
                    let text = row.get(column).and_then(|cell| cell.lines().nth(line)).unwrap_or_default();
                    let room = " ".repeat(width - text.width());
                    let gap = if column == 0 { " " } else { "  " };
                    match self.left.contains(&column) {
                        true => write!(f, "{gap}{text}{room} ")?,
                        false => write!(f, "{gap}{room}{text} ")?,
                    }
                }
                writeln!(f)?;
            }
            if index == 0 {
                writeln!(f, "{}", rule("\u{2550}"))?;
            }
        }
        f.write_str(&rule("\u{2500}"))
    }
}

#[cfg(test)]
mod tests {
    use super::table;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let mut rows = table(["name", "a\nb", "c"].map(str::to_owned));
        rows.align_left([2]);
        rows.add_row(["\u{6f22}", "12.5", ""]);
        rows.add_row(["long name", "1", "d"]);
        let rules = ["\u{2500}", "\u{2550}"].map(|kind| kind.repeat(22));
        let lines = [
            rules[0].as_str(),
            " name           a   c ",
            "                b     ",
            rules[1].as_str(),
            " \u{6f22}          12.5     ",
            " long name      1   d ",
            rules[0].as_str(),
        ];
        assert_eq!(rows.to_string(), lines.join("\n"));
    }
}
