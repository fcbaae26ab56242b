//! Equations as people read them.

/// An equation with the letters and exponents that the descriptions spell in ASCII.
pub fn equation(ascii: &str) -> String {
    let mut words = String::new();
    let mut word = String::new();
    for c in ascii.chars().chain(std::iter::once(' ')) {
        if c.is_ascii_alphabetic() {
            word.push(c);
            continue;
        }
        words.push_str(match word.as_str() {
            "alpha" => "α",
            "beta" => "β",
            "gamma" => "γ",
            "phi" => "φ",
            "pi" => "π",
            "sum" => "Σ",
            "tau" => "τ",
            "zeta" => "ζ",
            other => other,
        });
        word.clear();
        words.push(c);
    }
    let signs = [
        ("^2", "²"),
        ("^3", "³"),
        ("<=", "≤"),
        ("_1", "₁"),
        ("_2", "₂"),
        ("_i", "ᵢ"),
        (" - ", " − "),
    ];
    let written = signs.iter().fold(words, |text, (from, to)| text.replace(from, to));
    written.trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::equation;

    #[test]
    fn val_equations_are_written_in_letters() {
        assert_eq!(equation("v'(t) = v(t - tau)"), "v'(t) = v(t − τ)");
        assert_eq!(equation("zeta_1 w^2 <= summand"), "ζ₁ w² ≤ summand");
    }
}
