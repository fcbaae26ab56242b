//! Arithmetic expressions of effect files: parsed once into a short list of steps, run without allocation.
//!
//! Own code, because no kept library reads what an engineer writes: see "Why ..." in `ARCHITECTURE.md`.

use super::fault::Misread;
use std::fmt::Write;

/// Longest text, characters: no equation of physics needs more, and a longer one is a mistake.
const LONGEST: usize = 1000;

/// Intermediate results that wait at once; brackets deeper than that are refused.
const DEEPEST: usize = 24;

/// Brackets, signs and powers inside each other while parsing.
const MOST_NESTED: usize = 60;

#[derive(Debug, Clone, Copy)]
enum Step {
    Leaf(Leaf),
    Negate,
    WholePower(i32),
    Of1(fn(f64) -> f64),
    /// Of the value before the last one and the last one.
    Two(Two),
    /// Of the last value and a leaf, which need not wait for its turn.
    WithLeaf(Two, Leaf),
    Of3(fn(f64, f64, f64) -> f64),
}

#[derive(Debug, Clone, Copy)]
enum Leaf {
    Number(f64),
    Variable(usize),
}

/// What takes two values.
#[derive(Debug, Clone, Copy)]
enum Two {
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    Of(fn(f64, f64) -> f64),
}

impl Leaf {
    fn value(self, values: &[f64]) -> f64 {
        match self {
            Self::Number(value) => value,
            Self::Variable(index) => values[index],
        }
    }
}

impl Two {
    fn of(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Add => a + b,
            Self::Subtract => a - b,
            Self::Multiply => a * b,
            Self::Divide => a / b,
            Self::Power => a.powf(b),
            Self::Of(f) => f(a, b),
        }
    }
}

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

/// Exponents that are multiplied out; `powf` costs as much as ten products.
const WHOLE: f64 = 8.0;

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

/// A parsed expression.
#[derive(Debug, Clone)]
pub(super) struct Expression {
    steps: Vec<Step>,
    /// Values that wait at once below the last one.
    waiting: usize,
}

/// As many values wait in most equations.
const FEW: usize = 3;

impl Expression {
    /// Parses; `names` are the variables, in the order of the values given to [`Self::eval`].
    ///
    /// # Errors
    /// In words: what stands where, and what is allowed there.
    pub(super) fn parse(text: &str, names: &[&str]) -> Result<Self, Misread> {
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
        Ok(Self::of(parser.steps))
    }

    fn of(steps: Vec<Step>) -> Self {
        let (mut values, mut most) = (0_usize, 1);
        for step in &steps {
            values = values + 1 - takes(step);
            most = most.max(values);
        }
        Self {
            steps,
            waiting: most - 1,
        }
    }

    /// Whether a variable stands in it.
    pub(super) fn uses(&self, variable: usize) -> bool {
        let is_it = |leaf: &Leaf| matches!(leaf, Leaf::Variable(index) if *index == variable);
        let leaf = |step: &Step| matches!(step, Step::Leaf(leaf) | Step::WithLeaf(_, leaf) if is_it(leaf));
        self.steps.iter().any(leaf)
    }

    /// The same with the values of some variables put in, and worked out as far as they reach.
    pub(super) fn with(&self, known: impl Fn(usize) -> Option<f64>) -> Self {
        let mut steps = Vec::with_capacity(self.steps.len());
        let put_in = |leaf: Leaf| match leaf {
            Leaf::Variable(index) => known(index).map_or(leaf, Leaf::Number),
            Leaf::Number(_) => leaf,
        };
        for &step in &self.steps {
            match step {
                Step::Leaf(leaf) => append(&mut steps, Step::Leaf(put_in(leaf))),
                Step::WithLeaf(two, leaf) => {
                    append(&mut steps, Step::Leaf(put_in(leaf)));
                    append(&mut steps, Step::Two(two));
                }
                _ => append(&mut steps, step),
            }
        }
        Self::of(steps)
    }

    /// The value; not finite where the arithmetic is not.
    pub(super) fn eval(&self, values: &[f64]) -> f64 {
        if self.waiting <= FEW {
            self.eval_beside(&mut [0.0; FEW], values)
        } else {
            self.eval_beside(&mut [0.0; DEEPEST], values)
        }
    }

    fn eval_beside(&self, waiting: &mut [f64], values: &[f64]) -> f64 {
        // The steps are counted: never more than these wait, and each step finds what it takes.
        let (mut last, mut top) = (0.0, 0);
        for (place, step) in self.steps.iter().enumerate() {
            match *step {
                Step::Leaf(leaf) => {
                    if place > 0 {
                        waiting[top] = last;
                        top += 1;
                    }
                    last = leaf.value(values);
                }
                Step::Negate => last = -last,
                Step::WholePower(n) => last = last.powi(n),
                Step::Of1(f) => last = f(last),
                Step::Two(two) => {
                    top -= 1;
                    last = two.of(waiting[top], last);
                }
                Step::WithLeaf(two, leaf) => last = two.of(last, leaf.value(values)),
                Step::Of3(f) => {
                    top -= 2;
                    last = f(waiting[top], waiting[top + 1], last);
                }
            }
        }
        last
    }
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

/// How many waiting values a step takes.
fn takes(step: &Step) -> usize {
    match step {
        Step::Leaf(_) => 0,
        Step::Negate | Step::WholePower(_) | Step::Of1(_) | Step::WithLeaf(..) => 1,
        Step::Two(_) => 2,
        Step::Of3(_) => 3,
    }
}

/// Appends a step; what has numbers alone before it is worked out at once, and a leaf is taken by the step that follows it.
fn append(steps: &mut Vec<Step>, step: Step) {
    if let (Step::Two(Two::Power), Some(Step::Leaf(Leaf::Number(n)))) = (step, steps.last())
        && n.fract() == 0.0
        && n.abs() <= WHOLE
    {
        let n = *n as i32;
        steps.pop();
        return append(steps, Step::WholePower(n));
    }
    let from = steps.len().saturating_sub(takes(&step));
    let before = &steps[from..];
    let is_number = |step: &Step| matches!(step, Step::Leaf(Leaf::Number(_)));
    if !before.is_empty() && before.iter().all(is_number) {
        steps.push(step);
        let constant = Expression::of(steps.split_off(from));
        return steps.push(Step::Leaf(Leaf::Number(constant.eval(&[]))));
    }
    match (step, steps.last()) {
        (Step::Two(two), Some(&Step::Leaf(leaf))) => {
            steps.pop();
            steps.push(Step::WithLeaf(two, leaf));
        }
        _ => steps.push(step),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> f64 {
        let names = ["u", "max_um", "e"];
        Expression::parse(text, &names).unwrap().eval(&[3.0, 5.0, 7.0])
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
                assert!(Expression::parse(text, &["u", "max_um", "e"]).is_err(), "{text}");
            } else {
                assert!((value(text) - wanted).abs() < 1e-12, "{text}: {}", value(text));
            }
        }
    }

    #[test]
    fn val_constants_are_worked_out_once() {
        let names = ["u"];
        assert_eq!(Expression::parse("2*pi*3^2*u", &names).unwrap().steps.len(), 2);
        assert!(Expression::parse("2*u", &names).unwrap().uses(0));
        assert!(!Expression::parse("2*pi", &names).unwrap().uses(0));
        let decay = Expression::parse(
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
            let error = Expression::parse(text, &["u", "z"]).unwrap_err();
            assert!(error.to_string().contains(says), "{text}: {error}");
        }
    }
}
