//! The picture of README and introduction: made by `hysteron demo`, held against the program like a command block.

use super::blocks::Reading;
use crate::{output, targets};
use std::fs;
use std::path::Path;

const PICTURE: &str = "docs/pictures/error-falls.svg";

/// Makes the picture; what is wrong with the one in the book.
pub(super) fn check(program: &Path, reading: Reading) -> Result<Option<String>, String> {
    let folder = targets().join("docs").join("demo");
    println!("> {} demo", program.display());
    output(
        &program.display().to_string(),
        &["demo", "-o", &folder.display().to_string()],
    )?;
    let made =
        fs::read_to_string(folder.join("error-falls.svg")).map_err(|error| format!("error-falls.svg: {error}"))?;
    if fs::read_to_string(PICTURE).is_ok_and(|there| there == made) {
        return Ok(None);
    }
    match reading {
        Reading::Compare => Ok(Some(format!("{PICTURE}: `hysteron demo` makes another picture"))),
        Reading::Write => {
            fs::write(PICTURE, made).map_err(|error| format!("{PICTURE}: {error}"))?;
            Ok(None)
        }
    }
}
