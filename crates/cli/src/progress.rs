//! Progress bars on standard error, for everything that may take over two seconds.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

const STEPS: u64 = 1000;

/// A bar from 0 to 1 with a label. It shows only on a terminal, and not before half a second.
pub(crate) fn bar(label: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr_with_hz(4));
    if let Ok(style) = ProgressStyle::with_template("{msg:<24} [{wide_bar}] {percent:>3} %  {eta} left") {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.set_message(label.to_owned());
    bar
}

/// Moves a bar to a share done, 0 to 1; never backwards.
pub(crate) fn advance(bar: &ProgressBar, share: f64) {
    let position = (share.clamp(0.0, 1.0) * STEPS as f64) as u64;
    if position > bar.position() {
        bar.set_position(position);
    }
}

/// Names what runs, and moves a bar.
pub(crate) fn show(bar: &ProgressBar, what: &str, share: f64) {
    if bar.message() != what {
        bar.set_message(what.to_owned());
    }
    advance(bar, share);
}
