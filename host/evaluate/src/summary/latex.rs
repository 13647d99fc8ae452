//! A table as LaTeX, with the rules of the package `booktabs`: what leads its column is bold.

use super::{Column, Row, Table};

impl Table {
    /// A `table` with a caption: the columns of the table for people, intervals behind `\pm`, and what they mean.
    pub fn latex(&self, caption: &str) -> String {
        let columns = self.columns();
        let headings: String = columns.iter().map(|column| format!(" & {}", text(&self.heading(*column)))).collect();
        let rows: String = self.rows.iter().map(|row| self.latex_row(row, &columns)).collect();
        let format = "r".repeat(columns.len());
        let (caption, intervals) = (text(caption), text(&self.interval_words()));
        format!(
            "\\begin{{table}}\n  \\centering\n  \\caption{{{caption}. \
             {intervals}}}\n  \\begin{{tabular}}{{l{format}}}\n    \\toprule\n    \
             Scheme{headings} \\\\\n    \\midrule\n{rows}    \\bottomrule\n  \\end{{tabular}}\n\\end{{table}}\n"
        )
    }

    fn latex_row(&self, row: &Row, columns: &[Column]) -> String {
        let cells: String = columns.iter().map(|column| format!(" & {}", self.latex_cell(row, *column))).collect();
        format!("    {}{cells} \\\\\n", text(&row.scheme))
    }

    /// `$27.31 \pm 0.42$`; empty without a value.
    fn latex_cell(&self, row: &Row, column: Column) -> String {
        let metric = &self.metrics[column.metric(self)];
        let cell = row.cells[column.metric(self)].as_ref();
        let (interval, leads) = match column {
            Column::Value(_) => (cell.map(|cell| cell.value), cell.is_some_and(|cell| cell.leads)),
            _ => (column.difference(cell), false),
        };
        let is_difference = !matches!(column, Column::Value(_));
        interval.map_or(String::new(), |interval| {
            let written = metric.interval_text(&interval, is_difference).replace('±', "\\pm").replace("inf", "\\infty");
            if leads { format!("$\\mathbf{{{written}}}$") } else { format!("${written}$") }
        })
    }
}

/// Text with the characters that LaTeX would interpret written out.
fn text(plain: &str) -> String {
    let written = |character: char| match character {
        '&' | '%' | '$' | '#' | '_' | '{' | '}' => format!("\\{character}"),
        '\\' => "\\textbackslash{}".to_owned(),
        '~' => "\\textasciitilde{}".to_owned(),
        '^' => "\\textasciicircum{}".to_owned(),
        '±' => "$\\pm$".to_owned(),
        other => other.to_string(),
    };
    plain.chars().map(written).collect()
}
