//! Outcomes as tables: what is wanted and what was found, then by programme, family and effect, silence beside the wrong names.

use super::case::Kind;
use super::hidden::Effect;
use super::loops::Family;
use super::programme::Programme;
use super::score::{Grade, MOST_RECORDS, Outcome, Silence};
use super::statistics::{Share, median, median_text};
use super::tool::Said;
use std::collections::BTreeMap;
use std::fmt::Write;

/// All tables.
pub fn markdown(outcomes: &[Outcome]) -> String {
    let mut text = String::new();
    wanted(&mut text, outcomes);
    let programmes = Programme::ALL.map(|programme| (programme.name(), move |o: &Outcome| o.programme == programme));
    split(&mut text, "programme", outcomes, &programmes);
    let families = Family::ALL.map(|family| (family.name(), move |o: &Outcome| o.family == family));
    split(&mut text, "family", outcomes, &families);
    let is = |effect: Effect| move |o: &Outcome| matches!(o.truth.parts.as_slice(), [part] if part.hidden == super::Hidden::Effect(effect));
    let effects = Effect::ALL.map(|effect| (effect.name(), is(effect)));
    split(&mut text, "effect", outcomes, &effects);
    wrong_names(&mut text, outcomes);
    next_records(&mut text, outcomes);
    text
}

fn named_alone(grade: Grade) -> bool {
    matches!(grade, Grade::Right)
}

fn of_three(grade: Grade) -> bool {
    matches!(grade, Grade::Right | Grade::InSet(1..=3))
}

fn names_something(outcome: &Outcome) -> bool {
    outcome.said.as_ref().is_ok_and(|said| Said::is_name(&said.verdict))
}

fn ratio(outcome: &Outcome) -> Option<f64> {
    outcome.held_percent.map(|[before, after]| after / before)
}

fn bare_ratio(outcome: &Outcome) -> Option<f64> {
    let [before, _] = outcome.held_percent?;
    outcome.bare_percent.map(|bare| bare / before)
}

/// The rows of the first table: what, what is wanted, what was found.
fn wanted(text: &mut String, outcomes: &[Outcome]) {
    let counts: Vec<&Outcome> = outcomes.iter().filter(|o| o.counts()).collect();
    let of_kind = |kind: Kind| outcomes.iter().filter(move |o| o.truth.kind == kind);
    let sets = || {
        let set = |o: &&Outcome| {
            o.said
                .as_ref()
                .is_ok_and(|said| said.set().len() > usize::from(Said::is_name(&said.verdict)))
        };
        outcomes
            .iter()
            .filter(|o| matches!(o.truth.kind, Kind::One | Kind::Pair))
            .filter(set)
    };
    let named = || {
        outcomes
            .iter()
            .filter(|o| matches!(o.grade, Grade::Wrong) || names_alone(o))
    };
    let ratios = |of: &[&Outcome]| of.iter().filter_map(|o| ratio(o)).collect::<Vec<f64>>();
    let learned = || outcomes.iter().filter(|o| o.held_percent.is_some());
    let worse = |o: &&Outcome, limit: f64| ratio(o).is_some_and(|r| r > limit);
    let both = |o: &&Outcome| {
        o.truth
            .accepted()
            .iter()
            .all(|name| o.learned.iter().any(|l| l == name))
    };
    let rows = [
        (
            "an effect of 1 % and more named alone",
            ">= 60 %",
            Share::of(&counts, |o| named_alone(o.grade)).to_string(),
        ),
        (
            "the same, alone or in a set of at most three",
            ">= 88 %",
            Share::of(&counts, |o| of_three(o.grade)).to_string(),
        ),
        (
            "sets that contain what is there",
            ">= 95 %",
            Share::of(sets(), |o| matches!(o.grade, Grade::InSet(_))).to_string(),
        ),
        (
            "cases with a wrong effect alone",
            "<= 2 %",
            Share::of(outcomes, |o| o.grade == Grade::Wrong).to_string(),
        ),
        (
            "names alone that are wrong",
            "<= 4 %",
            Share::of(named(), |o| o.grade == Grade::Wrong).to_string(),
        ),
        (
            "nothing hidden, something named",
            "<= 1 %",
            Share::of(of_kind(Kind::Nothing), |o| names_something(o)).to_string(),
        ),
        (
            "outside the catalogue, named alone",
            "0",
            Share::of(of_kind(Kind::Outside), |o| o.grade == Grade::Wrong).to_string(),
        ),
        (
            "held out, after `learn` over before, an effect of 1 % and more",
            "<= 0.35",
            median_text(&ratios(&counts)),
        ),
        (
            "the same stages with nothing hidden, after `learn`, over the same before",
            "",
            median_text(&counts.iter().filter_map(|o| bare_ratio(o)).collect::<Vec<f64>>()),
        ),
        (
            "held out, worse than before (by more than a thousandth)",
            "<= 2 %",
            Share::of(learned(), |o| worse(o, 1.001)).to_string(),
        ),
        ("nothing hidden, held out above 1.05 of before", "0", {
            let nothing = learned().filter(|o| o.truth.kind == Kind::Nothing);
            Share::of(nothing, |o| worse(o, 1.05)).to_string()
        }),
        ("two hidden, both in what `learn` adds", ">= 80 %", {
            let pairs = learned().filter(|o| o.truth.kind == Kind::Pair && o.truth.parts.len() == 2);
            Share::of(pairs, both).to_string()
        }),
    ];
    let _ = writeln!(text, "| measured | wanted | found |\n|---|---|---|");
    for (what, wanted, found) in rows {
        let _ = writeln!(text, "| {what} | {wanted} | {found} |");
    }
    next_rows(text, outcomes);
}

fn names_alone(outcome: &Outcome) -> bool {
    outcome.grade == Grade::Right && names_something(outcome)
}

/// Of the cases that were open, those that further records named.
fn next_rows(text: &mut String, outcomes: &[Outcome]) {
    let open: Vec<&Outcome> = outcomes.iter().filter(|o| o.counts() && !o.asked.is_empty()).collect();
    let silent = outcomes.iter().filter(|o| {
        let open = matches!(o.grade, Grade::InSet(_) | Grade::Silent(_) | Grade::WrongSet);
        o.counts() && open && o.held_percent.is_some()
    });
    let until = |o: &&Outcome| o.asked.iter().position(|asked| asked.grade == Grade::Right);
    let needed: Vec<f64> = open.iter().filter_map(until).map(|n| n as f64 + 1.0).collect();
    let all: Vec<_> = outcomes.iter().flat_map(|o| &o.asked).collect();
    let rows = [
        (
            "open before, named after the next record",
            "",
            Share::of(&open, |o| until(o) == Some(0)).to_string(),
        ),
        (
            "open before, named after at most three",
            ">= 70 %",
            Share::of(&open, |o| until(o).is_some()).to_string(),
        ),
        ("open before, a wrong effect named after", "", {
            Share::of(&open, |o| {
                o.asked.last().is_some_and(|asked| asked.grade == Grade::Wrong)
            })
            .to_string()
        }),
        (
            "open before, no record proposed",
            "",
            Share::of(silent, |o| o.asked.is_empty()).to_string(),
        ),
        (
            "records until named, median",
            "<= 2",
            median(&needed).map_or("-".to_owned(), |n| format!("{n}")),
        ),
        (
            "records beyond the rig",
            "0",
            Share::of(all, |asked| !asked.beyond.is_empty()).to_string(),
        ),
    ];
    for (what, wanted, found) in rows {
        let _ = writeln!(text, "| {what} | {wanted} | {found} |");
    }
}

/// One table, a row for each part of the outcomes.
fn split<F: Fn(&Outcome) -> bool>(text: &mut String, title: &str, outcomes: &[Outcome], parts: &[(&str, F)]) {
    let _ = writeln!(
        text,
        "\n| {title} | effects of 1 % and more | alone | set of 2 or 3 | larger set | unknown | none | shape | refused | \
         wrong alone | wrong set | pairs, one right | nothing, named | outside, named alone | held out after / before |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|"
    );
    for (name, belongs) in parts {
        let of: Vec<&Outcome> = outcomes.iter().filter(|o| belongs(o)).collect();
        if of.is_empty() {
            continue;
        }
        let counts: Vec<&&Outcome> = of.iter().filter(|o| o.counts()).collect();
        let n = |rule: fn(Grade) -> bool| counts.iter().filter(|o| rule(o.grade)).count();
        let share = |kind: Kind, rule: fn(&Outcome) -> bool| {
            let share = Share::of(of.iter().filter(|o| o.truth.kind == kind), |o| rule(o));
            format!("{} / {}", share.of, share.all)
        };
        let ratios: Vec<f64> = counts.iter().filter_map(|o| ratio(o)).collect();
        let _ = writeln!(
            text,
            "| {name} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} | {} |",
            counts.len(),
            n(named_alone),
            n(|grade| matches!(grade, Grade::InSet(1..=3))),
            n(|grade| matches!(grade, Grade::InSet(4..))),
            n(|grade| grade == Grade::Silent(Silence::Unknown)),
            n(|grade| grade == Grade::Silent(Silence::Nothing)),
            n(|grade| grade == Grade::Silent(Silence::Shape)),
            n(|grade| matches!(grade, Grade::Silent(Silence::Refused) | Grade::Failed)),
            n(|grade| grade == Grade::Wrong),
            n(|grade| grade == Grade::WrongSet),
            share(Kind::Pair, |o| matches!(o.grade, Grade::Right | Grade::InSet(_))),
            share(Kind::Nothing, names_something),
            share(Kind::Outside, |o| o.grade == Grade::Wrong),
            median(&ratios).map_or("-".to_owned(), |r| format!("{r:.2}")),
        );
    }
}

fn wrong_names(text: &mut String, outcomes: &[Outcome]) {
    let mut rows: BTreeMap<(String, &str), Vec<u64>> = BTreeMap::new();
    for outcome in outcomes
        .iter()
        .filter(|o| matches!(o.grade, Grade::Wrong | Grade::WrongSet))
    {
        let hidden: Vec<&str> = outcome.truth.parts.iter().map(|part| part.hidden.name()).collect();
        let said = outcome.said.as_ref().map_or("", |said| said.verdict.as_str());
        rows.entry((hidden.join(" + "), said)).or_default().push(outcome.seed);
    }
    let _ = writeln!(text, "\n| hidden | named instead | seeds |\n|---|---|---|");
    for ((hidden, said), seeds) in rows {
        let hidden = if hidden.is_empty() { "nothing" } else { &hidden };
        let seeds: Vec<String> = seeds.iter().map(u64::to_string).collect();
        let _ = writeln!(text, "| {hidden} | {said} | {} |", seeds.join(", "));
    }
}

/// Which records were asked for.
fn next_records(text: &mut String, outcomes: &[Outcome]) {
    let mut rows: BTreeMap<&str, [usize; 4]> = BTreeMap::new();
    for asked in outcomes.iter().flat_map(|o| &o.asked) {
        let row = rows.entry(asked.words.as_str()).or_default();
        row[0] += 1;
        row[1] += usize::from(asked.grade == Grade::Right);
        row[2] += usize::from(matches!(asked.grade, Grade::Wrong | Grade::WrongSet));
        row[3] += usize::from(!asked.beyond.is_empty());
    }
    if rows.is_empty() {
        return;
    }
    let _ = writeln!(
        text,
        "\n| next record, at most {MOST_RECORDS} a case | asked for | then right | then wrong | beyond the rig |\n|---|---|---|---|---|"
    );
    for (words, [asked, right, wrong, beyond]) in rows {
        let _ = writeln!(text, "| {words} | {asked} | {right} | {wrong} | {beyond} |");
    }
}
