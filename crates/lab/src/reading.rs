//! How a file that was brought is read, and the command that reads it so.

use crate::error::Refusal;
use hysteron_data::Role;
use hysteron_data::import::{ColumnChoice, Gaps, ImportOptions, Jitter, Missing};
use serde::{Deserialize, Serialize};

/// The file that makes a dataset of the recordings beside it.
pub(crate) const MANIFEST: &str = "dataset.toml";

/// How a file is read, in the options of `hysteron import`.
#[derive(Debug, Clone, Serialize, Deserialize, Default, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Reading {
    /// `voltage=CH1:mV*20`, as `--column`.
    pub(crate) columns: Vec<String>,
    /// As `--rate`.
    pub(crate) rate_hz: Option<f64>,
    /// As `--missing`, `--gaps`, `--jitter`; `refuse` if empty.
    pub(crate) missing: String,
    pub(crate) gaps: String,
    pub(crate) jitter: String,
}

impl Reading {
    /// The options of the importer.
    pub(crate) fn options(&self, role: Role) -> Result<ImportOptions, Refusal> {
        let columns = self.columns.iter().filter(|text| !text.trim().is_empty());
        let unknown =
            |what: &str, value: &str, known: &str| Refusal::bad(format!("{what} `{value}`: known are {known}"));
        Ok(ImportOptions {
            role,
            columns: columns
                .map(|text| text.parse::<ColumnChoice>().map_err(Refusal::unusable))
                .collect::<Result<_, _>>()?,
            rate_hz: self.rate_hz,
            missing: match self.missing.as_str() {
                "" | "refuse" => Missing::Refuse,
                "trim" => Missing::Trim,
                "interpolate" => Missing::Interpolate,
                other => return Err(unknown("missing", other, "refuse, trim, interpolate")),
            },
            gaps: match self.gaps.as_str() {
                "" | "refuse" => Gaps::Refuse,
                "split" => Gaps::Split,
                other => return Err(unknown("gaps", other, "refuse, split")),
            },
            jitter: match self.jitter.as_str() {
                "" | "refuse" => Jitter::Refuse,
                "clock" => Jitter::Clock,
                "interpolate" => Jitter::Interpolate,
                other => return Err(unknown("jitter", other, "refuse, clock, interpolate")),
            },
            ..ImportOptions::default()
        })
    }

    /// The options as they are typed.
    pub(crate) fn typed(&self) -> String {
        let mut options = String::new();
        for column in self.columns.iter().filter(|text| !text.trim().is_empty()) {
            options.push_str(&format!(" --column {}", quoted(column)));
        }
        if let Some(rate) = self.rate_hz {
            options.push_str(&format!(" --rate {rate}"));
        }
        for (option, value) in [
            ("missing", &self.missing),
            ("gaps", &self.gaps),
            ("jitter", &self.jitter),
        ] {
            if !value.is_empty() && value != "refuse" {
                options.push_str(&format!(" --{option} {value}"));
            }
        }
        options
    }
}

/// A file as the importer gets it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Source<'a> {
    pub(crate) name: &'a str,
    pub(crate) reading: &'a Reading,
    pub(crate) role: Role,
}

/// Whether the first import makes a dataset or adds to one that is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Target {
    New,
    There,
}

/// Files in the order in which the commands read them: those that are read alike together, and of these the ones to fit first.
pub(crate) fn in_order<'a>(files: &[Source<'a>]) -> Vec<Source<'a>> {
    groups(files).into_iter().flatten().collect()
}

fn groups<'a>(files: &[Source<'a>]) -> Vec<Vec<Source<'a>>> {
    let mut groups: Vec<Vec<Source<'a>>> = Vec::new();
    for file in files {
        match groups.iter_mut().find(|group| group[0].reading == file.reading) {
            Some(group) => group.push(*file),
            None => groups.push(vec![*file]),
        }
    }
    for group in &mut groups {
        group.sort_by_key(|file| file.role != Role::Identify);
    }
    groups
}

/// The import as it is typed in the session's folder, one command for all files that are read alike.
pub(crate) fn import_command(files: &[Source<'_>], folder: &str, target: Target) -> String {
    let mut commands = Vec::new();
    for group in groups(files) {
        let mut command = "hysteron import".to_owned();
        for file in &group {
            let validate = if file.role == Role::Validate { "--validate " } else { "" };
            command.push_str(&format!(" {validate}{}", quoted(&format!("uploads/{}", file.name))));
        }
        command.push_str(&group[0].reading.typed());
        if target == Target::There || !commands.is_empty() {
            command.push_str(" --append");
        }
        commands.push(format!("{command} -o {}", quoted(folder)));
    }
    commands.join(" && ")
}

/// A word as a shell reads it. Control characters are spelled: a line that is pasted must stay one line.
pub(crate) fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-=:+,".contains(c);
    if word.chars().any(char::is_control) {
        let mut bytes = [0; 4];
        let spelled = |c: char| match c {
            '\'' | '\\' => format!("\\{c}"),
            c if c.is_control() => c
                .encode_utf8(&mut bytes)
                .bytes()
                .map(|byte| format!("\\x{byte:02x}"))
                .collect(),
            c => c.to_string(),
        };
        return format!("$'{}'", word.chars().map(spelled).collect::<String>());
    }
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_files_that_are_read_otherwise_have_a_command_of_their_own() {
        let plain = Reading::default();
        let scope = Reading {
            columns: vec!["voltage=CH1:mV*20".to_owned()],
            rate_hz: Some(1000.0),
            missing: "trim".to_owned(),
            ..Reading::default()
        };
        let file = |name, reading, role| Source { name, reading, role };
        let files = [
            file("a.csv", &plain, Role::Validate),
            file("b.csv", &scope, Role::Identify),
            file("c d.csv", &plain, Role::Identify),
        ];
        assert_eq!(
            import_command(&files, "data", Target::New),
            "hysteron import 'uploads/c d.csv' --validate uploads/a.csv -o data && hysteron import uploads/b.csv \
             --column 'voltage=CH1:mV*20' --rate 1000 --missing trim --append -o data"
        );
        assert_eq!(
            import_command(&files[..1], "data-2", Target::There),
            "hysteron import --validate uploads/a.csv --append -o data-2"
        );
        let order: Vec<&str> = in_order(&files).iter().map(|file| file.name).collect();
        assert_eq!(order, ["c d.csv", "a.csv", "b.csv"]);
    }

    #[test]
    fn val_a_word_stays_one_word_on_one_line() {
        for (word, typed) in [
            ("data-2", "data-2"),
            ("", "''"),
            ("my data", "'my data'"),
            ("it's", "'it'\\''s'"),
            ("a;b", "'a;b'"),
            ("a\nrm -rf b", "$'a\\x0arm -rf b'"),
            ("a\t'\\\u{85}", "$'a\\x09\\'\\\\\\xc2\\x85'"),
        ] {
            assert_eq!(quoted(word), typed, "{word:?}");
            assert!(!quoted(word).contains(char::is_control), "{word:?}");
        }
    }
}
