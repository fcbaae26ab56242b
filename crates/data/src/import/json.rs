//! JSON as programs write records: columns (`{"t": [...], "u": [...]}`), rows (`[{"t": 0, "u": 1}, ...]`, also one a line),
//! what pandas' `to_json` makes in each of its orients, and a value with its unit (`{"unit": "V", "values": [...]}`).

use std::io::Read;

use serde_json::{Map, Value};

use super::arrays::{self, Array, Budget, Contents, Fault, Format, MOST_ARRAYS, broken};

/// JSON.
pub(crate) const FORMAT: Format = Format {
    what: "JSON file",
    noun: "column",
    again: "write it as columns, `{\"time_s\": [...], \"voltage_v\": [...], \"position_um\": [...]}`",
    read,
};

/// The largest file, bytes: a value takes some 20 times of its text while it is read.
const MOST_BYTES: usize = 128 << 20;

/// Whether a file begins as JSON that may hold numbers.
pub(crate) fn is_one(head: &[u8]) -> bool {
    let text = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head).trim_ascii_start();
    match text.split_first() {
        Some((b'{', rest)) => matches!(rest.trim_ascii_start().first(), Some(b'"')),
        // `[Header]` begins the head of many a text file
        Some((b'[', rest)) => match rest.trim_ascii_start().first() {
            Some(b'{' | b'[') => true,
            Some(sign) => sign.is_ascii_digit() || *sign == b'-',
            None => false,
        },
        _ => false,
    }
}

fn read(source: &mut dyn Read, progress: &mut dyn FnMut(u64)) -> Result<Contents, Fault> {
    let bytes = arrays::bytes(source, progress)?;
    if bytes.len() > MOST_BYTES {
        return Err(Fault::Foreign(
            format!("the JSON file is longer than {} MB", MOST_BYTES >> 20),
            "save it as CSV, as in `python -c \"import pandas; pandas.read_json('F.json').to_csv('F.csv')\"`".into(),
        ));
    }
    let budget = Budget::of(bytes.len());
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let values: Result<Vec<Value>, _> = serde_json::Deserializer::from_slice(text).into_iter().collect();
    let mut values = values.map_err(|error| Fault::Broken(format!("JSON: {error}")))?;
    let whole = if values.len() == 1 {
        values.remove(0)
    } else {
        Value::Array(values)
    };
    let mut found = Finder {
        contents: Contents::default(),
        budget,
    };
    found.value("", whole)?;
    Ok(found.contents)
}

struct Finder {
    contents: Contents,
    budget: Budget,
}

impl Finder {
    /// Finds the columns in a value.
    fn value(&mut self, name: &str, value: Value) -> Result<(), Fault> {
        if self.contents.arrays.len() + self.contents.skipped.len() >= MOST_ARRAYS {
            return broken(format!("more than {MOST_ARRAYS} columns"));
        }
        match value {
            Value::Object(object) => self.object(name, object),
            Value::Array(list) => self.list(name, list),
            Value::Number(number) => self.push(name, vec![number.as_f64().unwrap_or(f64::NAN)], 1, ""),
            _ => Ok(()), // remarks
        }
    }

    fn object(&mut self, name: &str, mut object: Map<String, Value>) -> Result<(), Fault> {
        // pandas' orient `split`, and its like
        if let (Some(Value::Array(columns)), Some(Value::Array(_))) = (object.get("columns"), object.get("data")) {
            let names: Option<Vec<String>> = columns
                .iter()
                .map(|column| column.as_str().map(str::to_owned))
                .collect();
            if let (Some(names), Some(Value::Array(rows))) = (names, object.remove("data")) {
                return self.rows(name, &names, rows);
            }
            return Ok(());
        }
        // a column with its rows' numbers as keys: pandas' own orient
        if object.len() > 1 && object.keys().all(|key| key.parse::<u64>().is_ok()) {
            let mut rows: Vec<(u64, Value)> = object
                .into_iter()
                .filter_map(|(key, value)| Some((key.parse().ok()?, value)))
                .collect();
            rows.sort_by_key(|(row, _)| *row);
            return self.list(name, rows.into_iter().map(|(_, value)| value).collect());
        }
        let unit = ["unit", "units"]
            .into_iter()
            .find_map(|key| Some(object.get(key)?.as_str()?.to_owned()));
        let first = self.contents.arrays.len();
        for (key, value) in object {
            let inner = matches!(key.as_str(), "values" | "value" | "data" | "samples") && unit.is_some();
            let of = match (name, inner) {
                ("", true) | ("", false) => key,
                (name, true) => name.to_owned(),
                (name, false) => format!("{name}.{key}"),
            };
            self.value(&of, value)?;
        }
        if let (Some(unit), [one]) = (unit, &mut self.contents.arrays[first..]) {
            one.unit = unit;
        }
        Ok(())
    }

    fn list(&mut self, name: &str, list: Vec<Value>) -> Result<(), Fault> {
        match list.first() {
            Some(Value::Object(_)) => self.records(name, list),
            Some(Value::Array(first)) => {
                let columns = first.len();
                let mut numbers = Vec::new();
                for row in &list {
                    match row {
                        Value::Array(row) if row.len() == columns => numbers.extend(row.iter().map(number)),
                        _ => return self.skip(name, "rows of different lengths"),
                    }
                }
                self.push(name, numbers, columns, "")
            }
            Some(Value::Number(_) | Value::Null) => {
                if let Some(other) = list
                    .iter()
                    .position(|value| !matches!(value, Value::Number(_) | Value::Null))
                {
                    return self.skip(name, &format!("entry {} is no number", other + 1));
                }
                self.push(name, list.iter().map(number).collect(), 1, "")
            }
            Some(Value::String(_)) => self.skip(name, "text"),
            _ => Ok(()),
        }
    }

    /// Rows that are objects.
    fn records(&mut self, name: &str, rows: Vec<Value>) -> Result<(), Fault> {
        let mut names: Vec<String> = Vec::new();
        for row in rows.iter().take(16) {
            let Value::Object(row) = row else {
                return self.skip(name, "rows of different kinds");
            };
            for key in row.keys() {
                if !names.contains(key) && names.len() < MOST_ARRAYS {
                    names.push(key.clone());
                }
            }
        }
        let rows = rows
            .into_iter()
            .map(|mut row| {
                Value::Array(
                    names
                        .iter()
                        .map(|key| row.get_mut(key).map_or(Value::Null, Value::take))
                        .collect(),
                )
            })
            .collect();
        self.rows(name, &names, rows)
    }

    /// Rows that are lists, with the names of their columns.
    fn rows(&mut self, name: &str, names: &[String], rows: Vec<Value>) -> Result<(), Fault> {
        for (index, column) in names.iter().enumerate() {
            let cells: Vec<Value> = rows
                .iter()
                .map(|row| row.get(index).cloned().unwrap_or(Value::Null))
                .collect();
            let of = if name.is_empty() || name == "data" {
                column.clone()
            } else {
                format!("{name}.{column}")
            };
            self.list(&of, cells)?;
        }
        Ok(())
    }

    fn skip(&mut self, name: &str, what: &str) -> Result<(), Fault> {
        let name = if name.is_empty() { "the list" } else { name };
        self.contents.skipped.push(format!("{name}: {what}"));
        Ok(())
    }

    fn push(&mut self, name: &str, values: Vec<f64>, columns: usize, unit: &str) -> Result<(), Fault> {
        let name = if name.is_empty() { "data" } else { name };
        self.budget.take(values.len() as u64, name)?;
        let rows = values.len() / columns.max(1);
        self.contents.arrays.push(Array {
            size: vec![rows, columns],
            last_fastest: true,
            unit: unit.to_owned(),
            label: name.rsplit('.').next().unwrap_or(name).to_owned(),
            ..Array::vector(name, values)
        });
        Ok(())
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}
