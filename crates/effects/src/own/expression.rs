//! Arithmetic expressions of effect files as a short list of steps, run without allocation.

/// Intermediate results at once; brackets deeper than that are refused.
pub(super) const DEEPEST: usize = 24;

#[derive(Debug, Clone, Copy)]
pub(super) enum Step {
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
pub(super) enum Leaf {
    Number(f64),
    Variable(usize),
}

/// What takes two values.
#[derive(Debug, Clone, Copy)]
pub(super) enum Two {
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

/// Exponents that are multiplied out; `powf` costs as much as ten products.
const WHOLE: f64 = 8.0;

/// A parsed expression.
#[derive(Debug, Clone)]
pub(super) struct Expression {
    pub(super) steps: Vec<Step>,
    /// Values that wait at once below the last one.
    waiting: usize,
}

/// As many values wait in most equations.
const FEW: usize = 3;

impl Expression {
    pub(super) fn of(steps: Vec<Step>) -> Self {
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

/// How many waiting values a step takes.
pub(super) fn takes(step: &Step) -> usize {
    match step {
        Step::Leaf(_) => 0,
        Step::Negate | Step::WholePower(_) | Step::Of1(_) | Step::WithLeaf(..) => 1,
        Step::Two(_) => 2,
        Step::Of3(_) => 3,
    }
}

/// Appends a step; what has numbers alone before it is worked out at once, and a leaf is taken by the step that follows it.
pub(super) fn append(steps: &mut Vec<Step>, step: Step) {
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
