//! HDF5: h5py's and Julia's files, NeXus, MATLAB's version 7.3. Every dataset of numbers is offered under its path.
//!
//! Units come from the attributes `units` or `unit`, a sample rate or period from an attribute or a number whose name says
//! so, and what a NeXus group names as its axis is a time where its name says nothing else.

use std::collections::HashMap;
use std::io::Read;

use hdf5_pure::{AttrValue, DType, Dataset, Datatype, File, Group};

use super::arrays::{self, Array, Budget, Contents, Fault, Format, MOST_ARRAYS, broken};
use super::numbers::Stored;
use super::spelling;
use crate::units::Quantity;

/// HDF5.
pub(crate) const FORMAT: Format = Format {
    what: "HDF5 file",
    noun: "dataset",
    again: "write it again, or convert it, as in `h5repack F.h5 G.h5`",
    read: read_paths,
};

/// MATLAB's version 7.3, which is HDF5.
pub(crate) const MATLAB: Format = Format {
    what: "MATLAB file of version 7.3",
    noun: "variable",
    again: "save it again with `save('file.mat','-v7')`",
    read: read_variables,
};

/// What a file begins with, at 0 or after a head of a power of two from 512 on.
pub(crate) const MAGIC: &[u8] = b"\x89HDF\r\n\x1a\n";

/// How deep groups may be nested: links can make circles.
const DEEPEST: usize = 16;

/// The most objects that are looked at.
const MOST_OBJECTS: usize = 2 * MOST_ARRAYS;

type Attributes = HashMap<String, AttrValue>;

fn read_paths(source: &mut dyn Read, progress: &mut dyn FnMut(u64)) -> Result<Contents, Fault> {
    read(source, progress, '/')
}

fn read_variables(source: &mut dyn Read, progress: &mut dyn FnMut(u64)) -> Result<Contents, Fault> {
    read(source, progress, '.')
}

fn read(source: &mut dyn Read, progress: &mut dyn FnMut(u64), joint: char) -> Result<Contents, Fault> {
    let bytes = arrays::bytes(source, progress)?;
    let budget = Budget::of(bytes.len());
    let file = File::from_bytes(bytes).map_err(|error| Fault::Broken(format!("HDF5: {error}")))?;
    let mut walk = Walk {
        contents: Contents::default(),
        budget,
        objects: 0,
        joint,
    };
    walk.group(&file.root(), "", 0)?;
    Ok(walk.contents)
}

struct Walk {
    contents: Contents,
    budget: Budget,
    objects: usize,
    /// Between the pieces of a path.
    joint: char,
}

impl Walk {
    fn group(&mut self, group: &Group, path: &str, depth: usize) -> Result<(), Fault> {
        let fault = |error: hdf5_pure::Error| Fault::Broken(format!("HDF5, group /{path}: {error}"));
        let attributes = group.attrs().unwrap_or_default();
        self.scalars(path, &attributes)?;
        let axes = axes(&attributes);
        for (name, dataset) in group.iter_datasets().map_err(fault)? {
            self.count()?;
            let path = self.path(path, &name);
            if let Err(what) = self.dataset(&dataset, &path, &name, axes.contains(&name))? {
                self.contents.skipped.push(format!("{path}: {what}"));
            }
        }
        for (name, inner) in group.iter_groups().map_err(fault)? {
            self.count()?;
            // MATLAB keeps what cells and objects refer to in groups of these names
            if name.starts_with('#') {
                continue;
            }
            let path = self.path(path, &name);
            if depth >= DEEPEST {
                self.contents.skipped.push(format!("{path}: nested too deep"));
                continue;
            }
            self.group(&inner, &path, depth + 1)?;
        }
        Ok(())
    }

    fn count(&mut self) -> Result<(), Fault> {
        self.objects += 1;
        if self.objects > MOST_OBJECTS || self.contents.arrays.len() >= MOST_ARRAYS {
            return broken(format!("more than {MOST_OBJECTS} groups and datasets"));
        }
        Ok(())
    }

    fn path(&self, outer: &str, name: &str) -> String {
        if outer.is_empty() {
            name.to_owned()
        } else {
            format!("{outer}{}{name}", self.joint)
        }
    }

    /// Numbers among the attributes, which may be a sample rate or period.
    fn scalars(&mut self, path: &str, attributes: &Attributes) -> Result<(), Fault> {
        let mut found: Vec<(&String, f64)> = attributes
            .iter()
            .filter_map(|(name, value)| Some((name, number(value)?)))
            .collect();
        found.sort_by(|a, b| a.0.cmp(b.0));
        for (name, value) in found.into_iter().filter(|(name, _)| arrays::is_clock_name(name)) {
            self.budget.take(1, name)?;
            self.contents.arrays.push(Array {
                label: name.clone(),
                ..Array::vector(format!("{path}@{name}"), vec![value])
            });
        }
        Ok(())
    }

    /// A dataset's numbers; or what it is, if that is not read.
    fn dataset(&mut self, dataset: &Dataset, path: &str, name: &str, axis: bool) -> Result<Result<(), String>, Fault> {
        let attributes = dataset.attrs().unwrap_or_default();
        let class = attributes.get("MATLAB_class").and_then(text);
        if let Some(class) = class
            .as_deref()
            .filter(|class| matches!(*class, "char" | "cell" | "function_handle"))
        {
            return Ok(Err(match class {
                "char" => "text".into(),
                "cell" => "a cell array".into(),
                _ => "a function".into(),
            }));
        }
        if attributes.contains_key("MATLAB_empty") {
            return Ok(Ok(()));
        }
        let (Ok(kind), Ok(shape)) = (dataset.dtype(), dataset.shape()) else {
            return Ok(Err("of a type that is not read".into()));
        };
        let count = shape
            .iter()
            .try_fold(1u64, |count, &side| count.checked_mul(side))
            .unwrap_or(u64::MAX);
        let unit = ["units", "unit", "Units", "Unit"]
            .into_iter()
            .find_map(|name| attributes.get(name).and_then(text));
        let mut array = Array {
            label: label(name, unit.as_deref(), axis),
            unit: unit.unwrap_or_default(),
            size: shape
                .iter()
                .map(|&side| usize::try_from(side).unwrap_or(usize::MAX))
                .collect(),
            last_fastest: true,
            single: kind == DType::F32,
            ..Array::vector(path, Vec::new())
        };
        self.scalars(path, &attributes)?;
        if let DType::Compound(_) = kind {
            return self.rows(dataset, path, count, &array);
        }
        if !is_number(&kind) {
            return Ok(Err(match kind {
                DType::String | DType::VariableLengthString => "text".into(),
                DType::ObjectReference => "references".into(),
                other => format!("of type {other}"),
            }));
        }
        self.budget.take(count, &format!("dataset {path}"))?;
        array.values = match dataset.read_f64() {
            Ok(values) => values,
            Err(error) => return Ok(Err(error.to_string())),
        };
        self.contents.arrays.push(array);
        Ok(Ok(()))
    }

    /// Rows of named fields: an array a field.
    fn rows(&mut self, dataset: &Dataset, path: &str, count: u64, of: &Array) -> Result<Result<(), String>, Fault> {
        let (Ok(Datatype::Compound { size, members }), Ok(width)) = (dataset.datatype(), dataset.element_size()) else {
            return Ok(Err("rows of a type that is not read".into()));
        };
        self.budget
            .take(count.saturating_mul(width.div_ceil(8)), &format!("dataset {path}"))?;
        let raw = match dataset.read_raw() {
            Ok(raw) => raw,
            Err(error) => return Ok(Err(error.to_string())),
        };
        for member in members {
            let name = self.path(path, &member.name);
            let (Some(stored), Ok(from)) = (stored(&member.datatype), usize::try_from(member.byte_offset)) else {
                self.contents.skipped.push(format!("{name}: no numbers"));
                continue;
            };
            let (stored, big_endian) = stored;
            let Some(end) = from.checked_add(stored.width()).filter(|&end| end <= size as usize) else {
                return Ok(Err("rows whose fields are longer than they".into()));
            };
            let rows = raw.chunks_exact((size as usize).max(1));
            self.contents.arrays.push(Array {
                values: rows.map(|row| stored.number(&row[from..end], big_endian)).collect(),
                single: stored == Stored::Single,
                name,
                label: member.name,
                ..of.clone()
            });
        }
        Ok(Ok(()))
    }
}

/// What a dataset is recognised by: its name; of an axis that names no quantity, time, unless its unit is of another.
fn label(name: &str, unit: Option<&str>, axis: bool) -> String {
    let with_unit = unit.map_or_else(|| name.to_owned(), |unit| format!("{name} [{unit}]"));
    let known = spelling::read(&with_unit).quantity.is_some();
    let is_time = unit.is_none_or(|unit| spelling::unit(Quantity::Time, unit).is_some());
    if axis && !known && is_time {
        "time".into()
    } else {
        name.to_owned()
    }
}

/// The datasets that a NeXus group of data names as its axes.
fn axes(attributes: &Attributes) -> Vec<String> {
    if attributes.get("NX_class").and_then(text).as_deref() != Some("NXdata") {
        return Vec::new();
    }
    let Some(value) = attributes.get("axes") else {
        return Vec::new();
    };
    match texts(value) {
        Some(axes) => axes.to_vec(),
        // in the old way they are in one text
        None => text(value).map_or(Vec::new(), |axes| axes.split([':', ',']).map(str::to_owned).collect()),
    }
}

fn texts(value: &AttrValue) -> Option<&[String]> {
    match value {
        AttrValue::StringArray(list)
        | AttrValue::AsciiStringArray(list)
        | AttrValue::VarLenStringArray(list)
        | AttrValue::VarLenAsciiStringArray(list) => Some(list),
        _ => None,
    }
}

fn text(value: &AttrValue) -> Option<String> {
    Some(match value {
        AttrValue::String(text)
        | AttrValue::AsciiString(text)
        | AttrValue::VarLenString(text)
        | AttrValue::VarLenAsciiString(text) => text.clone(),
        AttrValue::StringSized { value, .. } | AttrValue::AsciiStringSized { value, .. } => value.clone(),
        other => match texts(other) {
            Some([one]) => one.clone(),
            _ => return None,
        },
    })
}

fn number(value: &AttrValue) -> Option<f64> {
    Some(match value {
        AttrValue::F64(value) => *value,
        AttrValue::F32(value) => f64::from(*value),
        AttrValue::I64(value) => *value as f64,
        AttrValue::I32(value) => f64::from(*value),
        AttrValue::U64(value) => *value as f64,
        AttrValue::U32(value) => f64::from(*value),
        AttrValue::I16(value) => f64::from(*value),
        AttrValue::U16(value) => f64::from(*value),
        AttrValue::F64Array(list) if list.len() == 1 => list[0],
        _ => return None,
    })
}

fn is_number(kind: &DType) -> bool {
    matches!(
        kind,
        DType::F32
            | DType::F64
            | DType::I8
            | DType::I16
            | DType::I32
            | DType::I64
            | DType::U8
            | DType::U16
            | DType::U32
            | DType::U64
    )
}

/// How a field of a row is stored, and whether its big end is first.
fn stored(datatype: &Datatype) -> Option<(Stored, bool)> {
    use hdf5_pure::DatatypeByteOrder as Order;
    match datatype {
        Datatype::FixedPoint {
            size: size @ (1 | 2 | 4 | 8),
            byte_order,
            layout,
        } => {
            let width = *size as usize;
            let stored = if layout.signed {
                Stored::Signed(width)
            } else {
                Stored::Unsigned(width)
            };
            Some((stored, *byte_order == Order::BigEndian))
        }
        Datatype::FloatingPoint {
            size: size @ (2 | 4 | 8),
            byte_order,
            ..
        } => {
            let stored = match size {
                2 => Stored::Half,
                4 => Stored::Single,
                _ => Stored::Double,
            };
            Some((stored, *byte_order == Order::BigEndian))
        }
        _ => None,
    }
}
