// SPDX-License-Identifier: MPL-2.0

//! A table, for the terminal, for Markdown and for a page.

/// Rows of text under headings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// What it shows.
    pub caption: String,
    /// First row.
    pub headings: Vec<String>,
    /// The others, as many cells each.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// Markdown whose columns stand under each other in a terminal too.
    pub fn markdown(&self) -> String {
        let lines = || std::iter::once(&self.headings).chain(&self.rows);
        let width = |column: usize| {
            lines()
                .filter_map(|row| row.get(column))
                .map(|cell| cell.chars().count())
                .max()
                .unwrap_or(0)
                .max(3)
        };
        let widths: Vec<usize> = (0..self.headings.len()).map(width).collect();
        let line = |row: &Vec<String>| {
            let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, width))| match column {
                0 => format!(" {cell:<width$} |"),
                _ => format!(" {cell:>width$} |"),
            });
            format!("|{}\n", cells.collect::<String>())
        };
        let rule = widths.iter().enumerate().map(|(column, width)| match column {
            0 => format!("-{}-|", "-".repeat(*width)),
            _ => format!("-{}:|", "-".repeat(*width)),
        });
        let rows: String = self.rows.iter().map(line).collect();
        format!("{}\n\n{}|{}\n{rows}", self.caption, line(&self.headings), rule.collect::<String>())
    }

    /// For a page.
    pub fn html(&self) -> String {
        let cells = |tag: &str, row: &[String]| -> String {
            row.iter().map(|cell| format!("<{tag}>{}</{tag}>", escape(cell))).collect()
        };
        let row = |row: &Vec<String>| match row.split_first() {
            Some((first, rest)) => {
                format!("<tr><th scope=\"row\">{}</th>{}</tr>\n", escape(first), cells("td", rest))
            }
            None => String::new(),
        };
        format!(
            "<div class=\"scroll\"><table><caption>{}</caption>\n<thead><tr>{}</tr></thead>\n<tbody>\n{}</tbody></table></div>\n",
            escape(&self.caption),
            cells("th", &self.headings),
            self.rows.iter().map(row).collect::<String>()
        )
    }
}

/// Text as text of a page.
pub fn escape(text: &str) -> String {
    glib::markup_escape_text(text).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let row = |cells: [&str; 2]| cells.map(String::from).to_vec();
        Table {
            caption: "Of <all>".into(),
            headings: row(["tracker", "P %"]),
            rows: vec![row(["a&b", "—"]), row(["c", "100.0"])],
        }
    }

    #[test]
    fn columns_stand_under_each_other() {
        let expected = "Of <all>\n\n| tracker |   P % |\n|---------|------:|\n| a&b     |     — |\n| c       | 100.0 |\n";
        assert_eq!(table().markdown(), expected);
    }

    #[test]
    fn text_is_no_markup() {
        let html = table().html();
        assert!(
            html.contains("Of &lt;all&gt;") && html.contains("<th scope=\"row\">a&amp;b</th><td>—</td>"),
            "{html}"
        );
    }
}
