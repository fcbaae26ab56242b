//! The literals of Python that NumPy's headers are made of: dictionaries, lists and tuples, text, numbers, truth.

/// A literal.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Literal {
    Bool(bool),
    Whole(u64),
    Text(String),
    /// A list or a tuple.
    List(Vec<Literal>),
    Dictionary(Vec<(String, Literal)>),
}

/// How deep literals may be nested: a structured type has four levels.
const DEEPEST: usize = 8;

impl Literal {
    /// The value of a key.
    pub(crate) fn get(&self, key: &str) -> Option<&Literal> {
        match self {
            Literal::Dictionary(entries) => entries.iter().find(|(name, _)| name == key).map(|(_, value)| value),
            _ => None,
        }
    }

    /// A tuple of sizes.
    pub(crate) fn sizes(&self) -> Option<Vec<usize>> {
        let Literal::List(list) = self else { return None };
        list.iter()
            .map(|side| match side {
                Literal::Whole(side) => usize::try_from(*side).ok(),
                _ => None,
            })
            .collect()
    }
}

/// Reads a literal with nothing but blanks after it.
pub(crate) fn parse(text: &[u8]) -> Option<Literal> {
    let text = std::str::from_utf8(text).ok()?;
    let mut rest = text;
    let found = value(&mut rest, 0)?;
    rest.trim().is_empty().then_some(found)
}

fn value(rest: &mut &str, depth: usize) -> Option<Literal> {
    if depth > DEEPEST {
        return None;
    }
    *rest = rest.trim_start();
    let first = rest.chars().next()?;
    match first {
        '{' => dictionary(rest, depth),
        '[' => list(rest, ']', depth),
        '(' => list(rest, ')', depth),
        '\'' | '"' => text(rest, first).map(Literal::Text),
        '0'..='9' => {
            let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            let (digits, after) = rest.split_at(end);
            *rest = after.strip_prefix('L').unwrap_or(after); // Python 2
            digits.parse().ok().map(Literal::Whole)
        }
        _ => [("True", true), ("False", false)]
            .into_iter()
            .find_map(|(word, truth)| {
                *rest = rest.strip_prefix(word)?;
                Some(Literal::Bool(truth))
            }),
    }
}

/// Whether the next sign is this one; takes it.
fn sign(rest: &mut &str, sign: char) -> bool {
    match rest.trim_start().strip_prefix(sign) {
        Some(after) => {
            *rest = after;
            true
        }
        None => false,
    }
}

fn text(rest: &mut &str, quote: char) -> Option<String> {
    let inside = rest.strip_prefix(quote)?;
    let end = inside.find(quote)?;
    *rest = &inside[end + 1..];
    Some(inside[..end].to_owned())
}

fn list(rest: &mut &str, end: char, depth: usize) -> Option<Literal> {
    *rest = &rest[1..];
    let mut found = Vec::new();
    while !sign(rest, end) {
        found.push(value(rest, depth + 1)?);
        if !sign(rest, ',') && !rest.trim_start().starts_with(end) {
            return None;
        }
    }
    Some(Literal::List(found))
}

fn dictionary(rest: &mut &str, depth: usize) -> Option<Literal> {
    *rest = &rest[1..];
    let mut found = Vec::new();
    while !sign(rest, '}') {
        *rest = rest.trim_start();
        let quote = rest.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
        let key = text(rest, quote)?;
        if !sign(rest, ':') {
            return None;
        }
        found.push((key, value(rest, depth + 1)?));
        if !sign(rest, ',') && !rest.trim_start().starts_with('}') {
            return None;
        }
    }
    Some(Literal::Dictionary(found))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_headers_that_numpy_writes() {
        let found = parse(b"{'descr': '<f8', 'fortran_order': False, 'shape': (300,), }   \n").unwrap();
        assert_eq!(found.get("descr"), Some(&Literal::Text("<f8".into())));
        assert_eq!(found.get("fortran_order"), Some(&Literal::Bool(false)));
        assert_eq!(found.get("shape").unwrap().sizes(), Some(vec![300]));
        let found = parse(b"{'descr': [('t', '<f8'), ('u', '>i2', (2,))], 'shape': ()}").unwrap();
        assert_eq!(found.get("shape").unwrap().sizes(), Some(vec![]));
        assert!(matches!(found.get("descr"), Some(Literal::List(fields)) if fields.len() == 2));
    }

    #[test]
    fn refuse_what_is_no_literal() {
        for text in [
            "",
            "{",
            "{'a'}",
            "{'a': 1} x",
            "(1 2)",
            "[1,,2]",
            "{'a': -1}",
            "import os",
            "((((((((((1,),),),),),),),),),)",
        ] {
            assert_eq!(parse(text.as_bytes()), None, "{text}");
        }
    }
}
