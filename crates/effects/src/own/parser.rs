//! What an engineer writes, read into an [`Expression`].
//!
//! Own code, because no kept library reads that: see "Why ..." in `ARCHITECTURE.md`.

use super::expression::{DEEPEST, Expression, Leaf, Step, Two, append, takes};
use super::fault::Misread;
use std::fmt::Write;

/// Longest text, characters: no equation of physics needs more, and a longer one is a mistake.
const LONGEST: usize = 1000;

/// Brackets, signs and powers inside each other while parsing.
const MOST_NESTED: usize = 60;

#[derive(Clone, Copy)]
enum Function {
    Of1(fn(f64) -> f64),
    Of2(fn(f64, f64) -> f64),
    Of3(fn(f64, f64, f64) -> f64),
}

/// All functions.
const FUNCTIONS: [(&str, Function); 24] = [
    ("abs", Function::Of1(f64::abs)),
    ("acos", Function::Of1(f64::acos)),
    ("asin", Function::Of1(f64::asin)),
    ("atan", Function::Of1(f64::atan)),
    ("atan2", Function::Of2(f64::atan2)),
    ("cbrt", Function::Of1(f64::cbrt)),
    ("clip", Function::Of3(clip)),
    ("cos", Function::Of1(f64::cos)),
    ("cosh", Function::Of1(f64::cosh)),
    ("exp", Function::Of1(f64::exp)),
    ("floor", Function::Of1(f64::floor)),
    ("hypot", Function::Of2(f64::hypot)),
    ("ln", Function::Of1(f64::ln)),
    ("log10", Function::Of1(f64::log10)),
    ("max", Function::Of2(f64::max)),
    ("min", Function::Of2(f64::min)),
    ("mod", Function::Of2(f64::rem_euclid)),
    ("round", Function::Of1(f64::round)),
    ("sign", Function::Of1(sign)),
    ("sin", Function::Of1(f64::sin)),
    ("sinh", Function::Of1(f64::sinh)),
    ("sqrt", Function::Of1(f64::sqrt)),
    ("tan", Function::Of1(f64::tan)),
    ("tanh", Function::Of1(f64::tanh)),
];

fn clip(x: f64, low: f64, high: f64) -> f64 {
    // The upper end wins where the ends are crossed: no panic, unlike `f64::clamp`.
    x.max(low).min(high)
}

/// -1, 0 or 1; `f64::signum` knows no 0.
fn sign(x: f64) -> f64 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }
}

/// Whether a name means something in every expression, so that no parameter or state may have it.
pub(super) fn is_taken(name: &str) -> bool {
    name == "pi" || FUNCTIONS.iter().any(|(function, _)| *function == name)
}

/// Parses; `names` are the variables, in the order of the values given to [`Expression::eval`].
///
/// # Errors
/// In words: what stands where, and what is allowed there.
pub(super) fn parse(text: &str, names: &[&str]) -> Result<Expression, Misread> {
    let length = text.chars().count();
    if length > LONGEST {
        return Err(Misread {
            character: None,
            why: format!("{length} characters; an expression has at most {LONGEST}"),
        });
    }
    let mut parser = Parser {
        text,
        at: 0,
        names,
        steps: Vec::new(),
        waiting: 0,
        nested: 0,
    };
    parser.sum()?;
    if let Some(c) = parser.peek() {
        return Err(parser.unexpected(c));
    }
    Ok(Expression::of(parser.steps))
}

struct Parser<'a> {
    text: &'a str,
    /// Byte that comes next.
    at: usize,
    names: &'a [&'a str],
    steps: Vec<Step>,
    waiting: usize,
    nested: usize,
}

impl<'a> Parser<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    /// The next character that is no space.
    fn peek(&mut self) -> Option<char> {
        let spaces = self.rest().len() - self.rest().trim_start().len();
        self.at += spaces;
        self.rest().chars().next()
    }

    fn take(&mut self, wanted: char) -> bool {
        let there = self.peek() == Some(wanted);
        if there {
            self.at += wanted.len_utf8();
        }
        there
    }

    /// The character that the parser is at, from 1.
    fn column(&self) -> usize {
        self.text[..self.at].chars().count() + 1
    }

    /// What is wrong here.
    fn here(&self, why: impl Into<String>) -> Misread {
        at(self.column(), why)
    }

    fn unexpected(&self, c: char) -> Misread {
        let hint = match c {
            ')' => "; there is no `(` to it",
            ',' => "; a comma stands between the arguments of a function",
            '=' | '<' | '>' => "; comparisons are written with sign, min, max and clip",
            '%' => "; the remainder is mod(a, b)",
            _ if c.is_alphanumeric() || c == '(' => "; a product is written with `*`",
            _ => "; allowed are numbers, names, + - * / ^ ( ) and functions",
        };
        self.here(format!("`{c}` does not belong here{hint}"))
    }

    fn deeper<T>(&mut self, inner: impl FnOnce(&mut Self) -> Result<T, Misread>) -> Result<T, Misread> {
        self.nested += 1;
        if self.nested > MOST_NESTED {
            return Err(self.here("too deeply nested; split it into states or simplify it"));
        }
        let found = inner(self);
        self.nested -= 1;
        found
    }

    fn sum(&mut self) -> Result<(), Misread> {
        self.product()?;
        loop {
            let two = if self.take('+') {
                Two::Add
            } else if self.take('-') {
                Two::Subtract
            } else {
                return Ok(());
            };
            self.product()?;
            self.push(Step::Two(two))?;
        }
    }

    fn product(&mut self) -> Result<(), Misread> {
        self.factor()?;
        loop {
            let two = if self.take('*') {
                Two::Multiply
            } else if self.take('/') {
                Two::Divide
            } else {
                return Ok(());
            };
            self.factor()?;
            self.push(Step::Two(two))?;
        }
    }

    /// A sign binds less than a power: -x^2 is -(x^2).
    fn factor(&mut self) -> Result<(), Misread> {
        if self.take('-') {
            self.deeper(Self::factor)?;
            return self.push(Step::Negate);
        }
        if self.take('+') {
            return self.deeper(Self::factor);
        }
        self.operand()?;
        if self.take('^') {
            // From the right: 2^3^2 is 2^9.
            self.deeper(Self::factor)?;
            self.push(Step::Two(Two::Power))?;
        }
        Ok(())
    }

    fn operand(&mut self) -> Result<(), Misread> {
        match self.peek() {
            None => Err(self.here("it ends where a number, a name or a bracket is missing")),
            Some('(') => {
                self.at += 1;
                self.deeper(Self::sum)?;
                self.close()
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.name(),
            Some(c) => Err(self.unexpected(c)),
        }
    }

    fn close(&mut self) -> Result<(), Misread> {
        if self.take(')') {
            return Ok(());
        }
        let column = self.column();
        match self.peek() {
            Some(',') => Err(at(column, "one argument too many")),
            Some(c) => Err(self.unexpected(c)),
            None => Err(at(column, "`)` is missing")),
        }
    }

    fn number(&mut self) -> Result<(), Misread> {
        let rest = self.rest().as_bytes();
        let digits = |from: usize| rest[from..].iter().take_while(|b| b.is_ascii_digit()).count();
        let mut end = digits(0);
        if rest.get(end) == Some(&b'.') {
            end += 1 + digits(end + 1);
        }
        if matches!(rest.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(rest.get(end + 1), Some(b'+' | b'-')));
            let exponent = digits((end + 1 + sign).min(rest.len()));
            if exponent > 0 {
                end += 1 + sign + exponent;
            }
        }
        let written = &self.rest()[..end];
        match written.parse::<f64>() {
            Ok(value) if value.is_finite() => {
                self.at += end;
                self.push(Step::Leaf(Leaf::Number(value)))
            }
            _ => Err(self.here(format!("`{written}` is no number"))),
        }
    }

    fn name(&mut self) -> Result<(), Misread> {
        let rest = self.rest();
        let end = rest
            .find(|c: char| !(c.is_alphanumeric() || c == '_'))
            .unwrap_or(rest.len());
        let (name, column) = (&rest[..end], self.column());
        self.at += end;
        if let Some(index) = self.names.iter().position(|known| *known == name) {
            return self.push(Step::Leaf(Leaf::Variable(index)));
        }
        if name == "pi" {
            return self.push(Step::Leaf(Leaf::Number(std::f64::consts::PI)));
        }
        let Some((_, function)) = FUNCTIONS.iter().find(|(known, _)| *known == name) else {
            return Err(at(column, self.unknown(name)));
        };
        if !self.take('(') {
            return Err(at(column, format!("`{name}` is a function; write {name}(...)")));
        }
        let (arguments, step) = match *function {
            Function::Of1(f) => (1, Step::Of1(f)),
            Function::Of2(f) => (2, Step::Two(Two::Of(f))),
            Function::Of3(f) => (3, Step::Of3(f)),
        };
        for number in 1..=arguments {
            if number > 1 && !self.take(',') {
                let given = number - 1;
                return Err(self.here(format!("{name} takes {arguments} arguments, here is {given} of them")));
            }
            self.deeper(Self::sum)?;
        }
        self.close()?;
        self.push(step)
    }

    fn unknown(&self, name: &str) -> String {
        let mut text = format!("unknown name `{name}`; known here are");
        for known in self.names.iter().filter(|known| !known.is_empty()) {
            // Writing to a String does not fail.
            let _ = write!(text, " {known},");
        }
        text.push_str(" pi and the functions");
        for (known, _) in FUNCTIONS {
            let _ = write!(text, " {known}");
        }
        if name == "log" {
            text.push_str("; say ln or log10");
        }
        text
    }

    /// Appends a step, and counts what waits.
    fn push(&mut self, step: Step) -> Result<(), Misread> {
        self.waiting = self.waiting + 1 - takes(&step);
        if self.waiting > DEEPEST {
            return Err(self.here(format!(
                "more than {DEEPEST} intermediate results; split it into states or simplify it"
            )));
        }
        append(&mut self.steps, step);
        Ok(())
    }
}

/// What is wrong at a character.
fn at(character: usize, why: impl Into<String>) -> Misread {
    Misread {
        character: Some(character),
        why: why.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> f64 {
        let names = ["u", "max_um", "e"];
        parse(text, &names).unwrap().eval(&[3.0, 5.0, 7.0])
    }

    /// As the same formulas are read in a textbook, which is Rust's own arithmetic written out.
    #[test]
    fn val_expressions_are_read_as_in_a_textbook() {
        let pi = std::f64::consts::PI;
        for (text, wanted) in [
            ("-u^2", -9.0),
            ("exp(-u^2/2)", (-4.5f64).exp()),
            ("2^3^2", 512.0),
            ("2^-u", 0.125),
            ("u^-2", 1.0 / 9.0),
            ("u^0.5", 3f64.sqrt()),
            ("2*-u", -6.0),
            ("8/4/2", 1.0),
            ("2-3+4", 3.0),
            ("6/2*3", 9.0),
            ("1e-3*u + 2.5E+2 - .5", 0.003 + 250.0 - 0.5),
            ("e*2", 14.0),
            ("2e", f64::NAN),
            ("max_um + max(1, min(u, 9))", 8.0),
            ("clip(u, 0, 2) + clip(-u, -1, 2)", 1.0),
            ("sign(-u) + sign(0) + abs(-u)", 2.0),
            ("sin(2 * pi * u / 12)^2", (pi / 2.0).sin().powi(2)),
            ("atan2(u, 3) + hypot(u, 4)", pi / 4.0 + 5.0),
            ("mod(-1, u) + floor(-0.5) + round(1.6)", 3.0),
            ("((((u))))", 3.0),
            (" u\t+\n1 ", 4.0),
        ] {
            if wanted.is_nan() {
                assert!(parse(text, &["u", "max_um", "e"]).is_err(), "{text}");
            } else {
                assert!((value(text) - wanted).abs() < 1e-12, "{text}: {}", value(text));
            }
        }
    }

    #[test]
    fn val_constants_are_worked_out_once() {
        let names = ["u"];
        assert_eq!(parse("2*pi*3^2*u", &names).unwrap().steps.len(), 2);
        assert!(parse("2*u", &names).unwrap().uses(0));
        assert!(!parse("2*pi", &names).unwrap().uses(0));
        let decay = parse(
            "v + exp(-period / time) * (u - v)^order",
            &["u", "v", "period", "time", "order"],
        );
        let (values, decay) = ([3.0, 1.0, 0.2, 0.7, 2.0], decay.unwrap());
        let short = decay.with(|i| (i > 1).then(|| values[i]));
        assert!(short.steps.len() == 7 && (short.eval(&values) - decay.eval(&values)).abs() < 1e-15);
    }

    #[test]
    fn refuse_with_the_place_and_what_is_allowed() {
        let deep = "(".repeat(200) + "u" + &")".repeat(200);
        let long = "u+".repeat(600) + "u";
        let wide = "u-(".repeat(40) + "u" + &")".repeat(40);
        for (text, says) in [
            ("", "column 1: it ends where"),
            ("u +", "column 4: it ends where"),
            (
                "2u",
                "column 2: `u` does not belong here; a product is written with `*`",
            ),
            ("u(3)", "column 2: `(` does not belong here"),
            (
                "position*2",
                "column 1: unknown name `position`; known here are u, z, pi and the functions abs",
            ),
            ("log(u)", "say ln or log10"),
            ("sin u", "`sin` is a function; write sin(...)"),
            ("sin()", "column 5: `)` does not belong here"),
            ("min(u)", "column 6: min takes 2 arguments, here is 1 of them"),
            ("sin(u, 2)", "column 6: one argument too many"),
            ("(u", "column 3: `)` is missing"),
            ("u)", "column 2: `)` does not belong here; there is no `(` to it"),
            ("u < 2", "comparisons are written with"),
            ("u ** 2", "column 4: `*` does not belong here"),
            ("1.2.3", "column 4"),
            (".", "column 1: `.` is no number"),
            ("1e999", "`1e999` is no number"),
            ("µ+1", "unknown name `µ`"),
            (&deep, "too deeply nested"),
            (&wide, "more than 24 intermediate results"),
            (&long, "1201 characters; an expression has at most 1000"),
        ] {
            let error = parse(text, &["u", "z"]).unwrap_err();
            assert!(error.to_string().contains(says), "{text}: {error}");
        }
    }
}
