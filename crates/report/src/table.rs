//! Tables, and the one that sets a paper's figures beside ours.

use maud::{Markup, html};

use crate::number::{signed, significant, unit_text};

/// Characters up to which a text stays on one line.
const SHORT: usize = 28;

/// A table of more rows and at most so many columns stands in two columns on paper.
const LONG: usize = 12;
const NARROW: usize = 4;

/// One cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Cell {
    /// Words, set to the left.
    Text(String),
    /// A figure, set to the right.
    Number(String),
}

impl Cell {
    /// Words.
    pub fn text(text: impl Into<String>) -> Self {
        Cell::Text(text.into())
    }

    /// A figure with three significant digits; a dash where there is none.
    pub fn number(value: impl Into<Option<f64>>) -> Self {
        Cell::Number(value.into().map_or_else(|| "–".to_owned(), significant))
    }
}

/// A table with a heading for each column; the first column names the row.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Table {
    caption: String,
    columns: Vec<String>,
    rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table without rows.
    pub fn new(caption: impl Into<String>, columns: &[&str]) -> Self {
        let columns = columns.iter().map(|title| (*title).to_owned()).collect();
        Self {
            caption: caption.into(),
            columns,
            rows: Vec::new(),
        }
    }

    /// With one more row.
    #[must_use]
    pub fn row(mut self, cells: Vec<Cell>) -> Self {
        self.rows.push(cells);
        self
    }

    /// Whether there is nothing in it.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Whether it is many short rows: on paper it stands in two columns.
    fn is_long(&self) -> bool {
        self.rows.len() > LONG && self.columns.len() <= NARROW
    }

    pub(crate) fn render(&self) -> Markup {
        // A column is one of figures when a row has one there.
        let numeric = |column: usize| {
            self.rows
                .iter()
                .any(|row| matches!(row.get(column), Some(Cell::Number(_))))
        };
        html! {
            // Wide tables scroll by themselves; a keyboard reaches them.
            div.scroll.long[self.is_long()] tabindex="0" role="region" aria-label=(self.caption) {
                table {
                    caption { (self.caption) }
                    thead { tr {
                        @for (column, title) in self.columns.iter().enumerate() {
                            th scope="col" .number[numeric(column)] { (title) }
                        }
                    } }
                    tbody {
                        @for row in &self.rows { tr {
                            @for (column, cell) in row.iter().enumerate() {
                                @match (column, cell) {
                                    (0, Cell::Text(text) | Cell::Number(text)) => { th scope="row" { (text) } }
                                    (_, Cell::Text(text)) => { td .short[text.chars().count() <= SHORT] { (text) } }
                                    (_, Cell::Number(text)) => { td.number { (text) } }
                                }
                            }
                        } }
                    }
                }
            }
        }
    }
}

/// A figure that a paper states, and ours for the same thing.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PaperFigure {
    /// What it is: `open-loop rms error, MRPI, 500 Hz`.
    pub what: String,
    /// Its unit.
    pub unit: String,
    /// What the paper says; nothing where it gives no figure.
    pub paper: Option<f64>,
    /// What we find.
    pub ours: Option<f64>,
    /// Why they differ, or how ours was measured.
    pub remark: String,
}

/// The table of a paper's figures beside ours. The column of remarks is there when there is one.
pub fn paper_table(caption: impl Into<String>, figures: &[PaperFigure]) -> Table {
    let remarks = figures.iter().any(|figure| !figure.remark.is_empty());
    let mut columns = vec!["Figure", "Unit", "Paper", "Ours", "Ours − paper"];
    if remarks {
        columns.push("Remark");
    }
    let mut table = Table::new(caption, &columns);
    for figure in figures {
        // The paper's figure as the paper writes it; ours and the difference never with fewer decimals than that.
        let decimals = figure.paper.map_or(0, |paper| decimals(&paper.to_string()));
        let difference = figure.paper.zip(figure.ours).map(|(paper, ours)| {
            let decimals = decimals.max(self::decimals(&significant(ours)));
            let difference = signed(&format!("{:.decimals$}", ours - paper));
            if ours > paper {
                format!("+{difference}")
            } else {
                difference
            }
        });
        let ours = figure.ours.map(|ours| {
            let text = significant(ours);
            if text.contains('×') || self::decimals(&text) >= decimals {
                text
            } else {
                signed(&format!("{ours:.decimals$}"))
            }
        });
        let or_dash = |text: Option<String>| Cell::Number(text.unwrap_or_else(|| "–".to_owned()));
        let mut row = vec![
            Cell::text(&figure.what),
            Cell::text(unit_text(&figure.unit)),
            or_dash(figure.paper.map(|paper| signed(&paper.to_string()))),
            or_dash(ours),
            or_dash(difference),
        ];
        if remarks {
            row.push(Cell::text(&figure.remark));
        }
        table = table.row(row);
    }
    table
}

/// Digits after the point.
fn decimals(number: &str) -> usize {
    number
        .split_once('.')
        .map_or(0, |(_, digits)| digits.chars().take_while(char::is_ascii_digit).count())
}
