//! An image onto a board, by probe-rs and the debug probe that is on it.

use crate::BoardError;
use crate::image::Board;
use std::path::Path;
use std::process::{Command, Stdio};

/// What stands in an image before its board's name, which ends with a zero.
const FOR: &[u8] = b"hysteron image for ";

/// The program that writes flash, and its package.
const WRITER: &str = "probe-rs";

/// The board that an image is for.
///
/// # Errors
/// A file that cannot be read, one that is no image of a board.
pub fn board_of(image: &Path) -> Result<Board, BoardError> {
    let bytes = std::fs::read(image)?;
    let places = bytes
        .windows(FOR.len())
        .enumerate()
        .filter(|(_, window)| *window == FOR);
    let named = places.filter_map(|(place, _)| {
        let name = bytes.get(place + FOR.len()..)?;
        let end = name.iter().position(|&byte| byte == 0)?;
        Board::find(str::from_utf8(name.get(..end)?).ok()?)
    });
    let mut boards: Vec<Board> = named.filter(|board| board.chip().is_some()).collect();
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
/// As [`board_of`]; no probe-rs, one that fails.
pub fn flash(image: &Path, probe: Option<&str>) -> Result<Board, BoardError> {
    let board = board_of(image)?;
    let chip = board
        .chip()
        .ok_or_else(|| BoardError::NoBoardsImage(image.to_owned()))?;
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
