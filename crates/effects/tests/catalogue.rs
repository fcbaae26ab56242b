//! What every entry of the catalogue has, so that a new one is a folder and a line and is complete.
#![allow(clippy::unwrap_used, reason = "a test that cannot read the sources fails")]

use hysteron_effects::{Compensator, EffectId, EffectName, Facts, Family, OfFamily, Shape, catalogue};
use std::path::{Path, PathBuf};

fn facts() -> Facts {
    Facts {
        voltage_v: [0.0, 100.0],
        position_um: [0.0, 10.0],
        finest_period_s: 2e-5,
        finest_grid_s: 2e-5,
        longest_s: 10.0,
        peak_rate_v_per_s: 1e5,
        temperature_c: Some([20.0, 20.5, 21.0]),
        voltage2_v: Some([0.0, 100.0]),
        rests: true,
        family: Family::Pi,
    }
}

/// Records of some milliseconds tell creep from no lag.
#[test]
fn bva_creep_needs_a_record_on_both_sides() {
    let creep = hysteron_effects::find(EffectId::Creep);
    let of = |longest_s: f64| creep.bounds(&Facts { longest_s, ..facts() });
    assert!(of(0.31).is_ok());
    assert!(of(0.29).unwrap_err().contains("0.290 s"));
}

/// Words, bounds, starts and compensator of every effect fit each other.
#[test]
fn val_every_effect_is_complete() {
    for effect in catalogue() {
        let (name, d) = (effect.name(), effect.description());
        assert_eq!(d.name, name.as_str());
        for words in [
            d.summary,
            d.equation,
            d.source,
            d.shows,
            d.mistaken_for,
            d.separated_by,
            d.compensated_by,
        ] {
            assert!(words.len() > 8, "{name}: `{words}`");
        }
        let bounds = effect.bounds(&facts()).unwrap();
        assert_eq!(bounds.len(), d.parameters.len(), "{name}");
        for (b, p) in bounds.iter().zip(d.parameters) {
            assert!(
                b.min <= b.neutral && b.neutral <= b.max && b.scale > 0.0,
                "{name}: {} {b:?}",
                p.name
            );
            assert!(!p.what.is_empty() && (!b.fitted || b.min < b.max), "{name}: {}", p.name);
        }
        let starts = effect.starts(&facts(), &bounds);
        assert!(!starts.is_empty(), "{name}");
        for start in &starts {
            assert_eq!(start.len(), bounds.len(), "{name}");
            let inside = start.iter().zip(&bounds).all(|(v, b)| (b.min..=b.max).contains(v));
            assert!(inside, "{name}: {start:?} is outside of {bounds:?}");
        }
        let shape = Shape {
            family: Family::Pi,
            thresholds: vec![10.0, 30.0],
        };
        let place = |n: usize| (1..=n).map(|i| i as f64).collect();
        let reshaped = effect.reshape(&shape, &facts(), &place);
        assert_eq!(
            reshaped.is_some(),
            bounds.is_empty(),
            "{name} has parameters or a shape"
        );
        let compensation = effect.compensation(&starts[0]);
        assert!(compensation.note.len() > 20, "{name}: {}", compensation.note);
        assert_eq!(compensation.by == Compensator::None, compensation.by.name().is_none());
        assert!(effect.outside_family().is_none() && effect.file().is_none(), "{name}");
    }
}

/// A name is read back as what it was, and the effect under it has that name.
#[test]
fn val_names_are_read_back() {
    for id in EffectId::ALL {
        assert_eq!(id.effect().name(), id);
        assert_eq!(id.name().parse(), Ok(id));
        assert_eq!(EffectName::of(id.name()), EffectName::Catalogue(id));
    }
}

/// What a family has of its own becomes an effect of the catalogue outside of it.
#[test]
fn val_the_envelope_of_a_family_becomes_an_effect() {
    use hysteron_effects::Effect as _;
    let outside = OfFamily.outside_family().unwrap();
    assert_eq!(outside.name(), OfFamily.name());
    assert!(outside.outside_family().is_none());
    assert_eq!(outside.envelope(&[1e-5, 2e-5]), OfFamily.envelope(&[1e-5, 2e-5]));
}

#[test]
fn refuse_a_name_that_is_not_in_the_catalogue() {
    for (name, nearest) in [
        ("creeep", Some(EffectId::Creep)),
        ("Thermal Drift", Some(EffectId::ThermalDrift)),
        ("slew_limit", Some(EffectId::SlewLimit)),
        ("lag", None),
        ("", None),
    ] {
        let unknown = name.parse::<EffectId>().unwrap_err();
        assert_eq!(unknown.nearest, nearest, "{name}");
        let said = unknown.to_string();
        assert!(said.contains("the catalogue has delay, first-order-lag, "), "{said}");
        assert_eq!(said.contains("did you mean"), nearest.is_some(), "{said}");
    }
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ext| ext == "rs") {
            found.push(path);
        }
    }
}

/// An effect is a folder, its line in `list.rs` and its `mod` in `lib.rs`: no other file of this crate, and none that fits, names it, but for those of its wider
/// forms.
#[test]
fn val_an_effect_is_named_in_its_folder_and_its_line_only() {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let identify = Path::new(env!("CARGO_MANIFEST_DIR")).join("../identify/src");
    let mut all = Vec::new();
    sources(&own, &mut all);
    sources(&identify, &mut all);
    for id in EffectId::ALL {
        let folder = own.join(id.name().replace('-', "_"));
        assert!(folder.join("mod.rs").is_file(), "{id} has no folder");
        let wider = EffectId::ALL
            .into_iter()
            .filter(|other| other.effect().widens() == Some(id));
        let of_wider: Vec<PathBuf> = wider.map(|other| own.join(other.name().replace('-', "_"))).collect();
        let names_it = |path: &Path| path.starts_with(&folder) || of_wider.iter().any(|other| path.starts_with(other));
        for path in all.iter().filter(|path| !names_it(path)) {
            let text = std::fs::read_to_string(path).unwrap();
            let code: Vec<&str> = text
                .split("#[cfg(test)]")
                .next()
                .unwrap_or_default()
                .lines()
                .filter(|line| !line.trim_start().starts_with("//"))
                .collect();
            let named = [
                format!("EffectId::{id:?}"),
                format!("crate::{}", id.name().replace('-', "_")),
            ];
            for name in named {
                let line = code.iter().find(|line| line.contains(&name));
                assert!(line.is_none(), "{} names {id}: {line:?}", path.display());
            }
            if !["list.rs", "lib.rs"].iter().any(|file| path == &own.join(file)) {
                // "delay" and others are words of places as well; a match on a name has an arrow behind it or is compared.
                let literal = format!("\"{id}\"");
                let matched = code
                    .iter()
                    .find(|line| line.contains(&format!("{literal} =>")) || line.contains(&format!("== {literal}")));
                assert!(
                    matched.is_none() || path.ends_with("effect.rs"),
                    "{} matches on {id}: {matched:?}",
                    path.display()
                );
            }
        }
    }
}
