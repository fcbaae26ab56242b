//! Names of effects, typed.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

macro_rules! declare {
    ($($module:ident::$effect:ident = $name:literal,)*) => {
        /// An effect of the catalogue; its text is its name on the command line and in files.
        ///
        /// # Example
        /// ```
        /// use hysteron_effects::EffectId;
        /// assert_eq!("first-order-lag".parse(), Ok(EffectId::FirstOrderLag));
        /// assert_eq!(EffectId::FirstOrderLag.to_string(), "first-order-lag");
        /// let unknown = "first-order-lack".parse::<EffectId>().unwrap_err().to_string();
        /// assert!(unknown.starts_with("there is no effect `first-order-lack`; did you mean `first-order-lag`? the catalogue has delay, "));
        /// ```
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum EffectId {
            $(#[doc = concat!("`", $name, "`")] $effect,)*
        }

        impl EffectId {
            /// All of them, in the order of the list.
            pub const ALL: [Self; Self::COUNT] = [$(Self::$effect,)*];

            /// How many there are.
            pub const COUNT: usize = [$($name,)*].len();

            /// Its name on the command line and in files.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$effect => $name,)*
                }
            }
        }
    };
}
every_effect!(declare);

impl EffectId {
    /// Names of all effects, for messages.
    pub fn names() -> [&'static str; Self::COUNT] {
        Self::ALL.map(Self::name)
    }
}

impl fmt::Display for EffectId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A name that no effect of the catalogue has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub struct UnknownEffect {
    /// The name.
    pub name: String,
    /// The effect that it resembles, where it does.
    pub nearest: Option<EffectId>,
}

impl fmt::Display for UnknownEffect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "there is no effect `{}`; ", self.name)?;
        if let Some(nearest) = self.nearest {
            write!(f, "did you mean `{nearest}`? ")?;
        }
        let known = EffectId::names().join(", ");
        write!(
            f,
            "the catalogue has {known}; an effect file of your own ends with .toml"
        )
    }
}

impl FromStr for EffectId {
    type Err = UnknownEffect;

    fn from_str(name: &str) -> Result<Self, UnknownEffect> {
        Self::ALL
            .into_iter()
            .find(|id| id.name() == name)
            .ok_or_else(|| UnknownEffect {
                name: name.to_owned(),
                nearest: nearest(name),
            })
    }
}

/// The effect whose name is at most a third of its letters away.
fn nearest(name: &str) -> Option<EffectId> {
    let name: String = name.trim().to_lowercase().replace(['_', ' '], "-");
    let distance = |id: &EffectId| edits(&name, id.name());
    let nearest = EffectId::ALL.into_iter().min_by_key(distance)?;
    (3 * distance(&nearest) <= nearest.name().len()).then_some(nearest)
}

/// Letters put in, taken out or changed between two names (Levenshtein's distance); long ones are cut.
fn edits(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(40).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().take(40).enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, other) in b.iter().enumerate() {
            let changed = diagonal + usize::from(letter != *other);
            diagonal = row[j + 1];
            row[j + 1] = changed.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

impl Serialize for EffectId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

impl<'de> Deserialize<'de> for EffectId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        name.parse().map_err(serde::de::Error::custom)
    }
}

/// An effect's name: one of the catalogue's, or that of an effect file.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EffectName {
    /// Of the catalogue.
    Catalogue(EffectId),
    /// Of the user's own.
    Own(String),
}

impl EffectName {
    /// The name as it stands in files; what the catalogue does not have is the user's own.
    pub fn of(name: &str) -> Self {
        name.parse()
            .map_or_else(|_| Self::Own(name.to_owned()), Self::Catalogue)
    }

    /// The text in files and on the command line.
    pub fn as_str(&self) -> &str {
        match self {
            Self::Catalogue(id) => id.name(),
            Self::Own(name) => name,
        }
    }

    /// The effect of the catalogue; `None` for the user's own.
    pub fn id(&self) -> Option<EffectId> {
        match self {
            Self::Catalogue(id) => Some(*id),
            Self::Own(_) => None,
        }
    }
}

impl From<EffectId> for EffectName {
    fn from(id: EffectId) -> Self {
        Self::Catalogue(id)
    }
}

impl PartialEq<EffectId> for EffectName {
    fn eq(&self, id: &EffectId) -> bool {
        self.id() == Some(*id)
    }
}

impl fmt::Display for EffectName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl Serialize for EffectName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for EffectName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Self::of(&String::deserialize(deserializer)?))
    }
}
