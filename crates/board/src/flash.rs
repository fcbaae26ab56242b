//! An image onto a board, by probe-rs and the debug probe that is on it.

use crate::BoardError;
use crate::image::Board;
use std::path::Path;
use std::process::{Command, Stdio};

/// What stands in an image before its board's name, which ends with a zero.
const FOR: &[u8] = b"hysteron image for ";

/// The program that writes flash, and its package.
const WRITER: &str = "probe-rs";

/// The board that an image is for, and its chip.
fn board_of(image: &Path) -> Result<(Board, &'static str), BoardError> {
    let bytes = std::fs::read(image)?;
    let places = bytes
        .windows(FOR.len())
        .enumerate()
        .filter(|(_, window)| *window == FOR);
    let named = places.filter_map(|(place, _)| {
        let name = bytes.get(place + FOR.len()..)?;
        let end = name.iter().position(|&byte| byte == 0)?;
        let board = Board::find(str::from_utf8(name.get(..end)?).ok()?)?;
        Some((board, board.chip()?))
    });
    let mut boards: Vec<(Board, &str)> = named.collect();
    boards.dedup();
    match boards.as_slice() {
        [board] if bytes.starts_with(b"\x7fELF") => Ok(*board),
        _ => Err(BoardError::NoBoardsImage(image.to_owned())),
    }
}

/// Writes an image and starts it: by the only probe, or the one of this serial number. What the writer says,
/// its progress among it, goes to standard error.
///
/// # Errors
/// A file that cannot be read or is no image of a board, no probe-rs, one that fails.
pub fn flash(image: &Path, probe: Option<&str>) -> Result<Board, BoardError> {
    let (board, chip) = board_of(image)?;
    let image = image.display().to_string();
    for words in [&["download", "--chip", chip, &image][..], &["reset", "--chip", chip]] {
        let mut writer = Command::new(WRITER);
        writer.args(words);
        if let Some(probe) = probe {
            writer.args(["--probe", probe]);
        }
        writer.stdout(Stdio::null());
        let ended = writer.status().map_err(|source| BoardError::NoWriter { source })?;
        if !ended.success() {
            return Err(BoardError::NotWritten { ended });
        }
    }
    Ok(board)
}
