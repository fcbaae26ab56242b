//! A reference of the user's own: one period in the points of the board's table.

use crate::BoardError;
use hysteron_firmware::trajectory::{CHUNK_POINTS, TABLE_POINTS};
use hysteron_firmware::tuning::Change;

/// One period, as the board takes it: shares of a range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Upload {
    /// Lowest and highest point, micrometres.
    pub range_um: [f64; 2],
    shares: [u16; TABLE_POINTS],
}

impl Upload {
    /// From text: a position in micrometres a line, as many lines as the table has points, and perhaps a line with a name before them.
    ///
    /// The board draws straight lines between the points, and from the last to the first.
    ///
    /// # Errors
    /// Another number of points, a line that is no finite number, points that are all the same.
    ///
    /// # Example
    /// ```
    /// # use hysteron_board::upload::Upload;
    /// let text: String = (0..256).map(|i| format!("{}\n", 1.0 + 0.001 * f64::from(i))).collect();
    /// assert_eq!(Upload::parse(&text).unwrap().range_um, [1.0, 1.255]);
    /// assert_eq!(
    ///     Upload::parse("1\n2\n").unwrap_err().to_string(),
    ///     "a reference has 256 points, one a line; here are 2"
    /// );
    /// ```
    pub fn parse(text: &str) -> Result<Self, BoardError> {
        let mut points = Vec::new();
        for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            match line.trim().parse::<f64>() {
                Ok(um) if um.is_finite() => points.push(um),
                // The name of the column.
                Err(_) if i == 0 => {}
                _ => {
                    return Err(BoardError::Point {
                        line: i + 1,
                        found: line.trim().to_owned(),
                    });
                }
            }
        }
        Self::of_positions(&points)
    }

    /// From positions in micrometres, as many as the table has points.
    ///
    /// # Errors
    /// Another number of points, points that are all the same.
    pub fn of_positions(points: &[f64]) -> Result<Self, BoardError> {
        let found = points.len();
        let points: [f64; TABLE_POINTS] = points.try_into().map_err(|_| BoardError::Points { found })?;
        let ends = |[low, high]: [f64; 2], &um: &f64| [low.min(um), high.max(um)];
        let range_um = points.iter().fold([f64::INFINITY, f64::NEG_INFINITY], ends);
        let [low_um, high_um] = range_um;
        if low_um as f32 >= high_um as f32 {
            return Err(BoardError::Flat { um: low_um });
        }
        let share = |um: f64| ((um - low_um) / (high_um - low_um) * 65_535.0).round() as u16;
        Ok(Self {
            range_um,
            shares: points.map(share),
        })
    }

    /// From shares of a range, the whole of which they need not reach.
    pub fn new(range_um: [f64; 2], shares: [u16; TABLE_POINTS]) -> Self {
        Self { range_um, shares }
    }

    /// The points, as shares of [`Self::range_um`].
    pub fn shares(&self) -> &[u16; TABLE_POINTS] {
        &self.shares
    }

    /// What the board is asked for, at its safe level, before it is asked for [`crate::Shape::Table`] over [`Self::range_um`].
    pub fn changes(&self) -> Vec<Change> {
        let (chunks, _) = self.shares.as_chunks::<CHUNK_POINTS>();
        (0..)
            .zip(chunks)
            .map(|(chunk, &shares)| Change::Chunk { chunk, shares })
            .collect()
    }
}
