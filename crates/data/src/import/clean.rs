//! What is done with missing cells.

use super::options::Missing;
use super::table::Table;
use crate::error::DataError;

/// Leaves out rows at both ends and closes single gaps, as told; says what it did.
pub(crate) fn missing(table: &mut Table, policy: Missing, file: &str) -> Result<Vec<String>, DataError> {
    if policy == Missing::Refuse {
        return refuse_any(table, file).map(|()| Vec::new());
    }
    let mut notices = Vec::new();
    let rows = table.rows();
    let complete = |row: &usize| table.values.iter().all(|values| values[*row].is_finite());
    let first = (0..rows).find(complete).unwrap_or(rows);
    let end = (first..rows).rev().find(complete).map_or(first, |last| last + 1);
    if first > 0 || end < rows {
        notices.push(format!(
            "{} rows at the beginning and {} at the end left out: cells missing",
            first,
            rows - end
        ));
        table.retain(|row| (first..end).contains(&row));
        table.first_line = table.first_line.map(|line| line + first as u64);
    }
    if policy == Missing::Interpolate {
        interpolate(table, &mut notices);
    }
    refuse_any(table, file)?;
    Ok(notices)
}

/// Replaces cells whose neighbours above and below are there by their mean.
fn interpolate(table: &mut Table, notices: &mut Vec<String>) {
    for (column, values) in table.values.iter_mut().enumerate() {
        let mut closed = 0;
        for row in 1..values.len().saturating_sub(1) {
            let (before, after) = (values[row - 1], values[row + 1]);
            if values[row].is_nan() && before.is_finite() && after.is_finite() {
                values[row] = before / 2.0 + after / 2.0;
                closed += 1;
            }
        }
        if closed > 0 {
            let name = &table.chosen[column].name;
            notices.push(format!(
                "column {} ({name}): {closed} missing samples interpolated",
                table.chosen[column].index + 1
            ));
        }
    }
}

/// Refuses the first missing cell.
fn refuse_any(table: &Table, file: &str) -> Result<(), DataError> {
    let first = |(column, values): (usize, &Vec<f64>)| {
        values
            .iter()
            .position(|value| !value.is_finite())
            .map(|row| (row, column))
    };
    match table.values.iter().enumerate().filter_map(first).min() {
        None => Ok(()),
        Some((row, column)) => Err(DataError::Cell {
            at: table.place(file, row, column),
            found: "no number".into(),
            allowed: "only rows at both ends (`--missing trim`) and single samples in between (`--missing \
                      interpolate`) can be missing; cut the record there"
                .into(),
        }),
    }
}
