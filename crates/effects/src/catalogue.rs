//! The catalogue: every effect by its name.

use crate::effect::Effect;
use crate::id::EffectId;
use std::sync::Arc;

macro_rules! declare {
    ($($module:ident::$effect:ident = $name:literal,)*) => {
        impl EffectId {
            /// The effect itself.
            pub fn effect(self) -> Arc<dyn Effect> {
                match self {
                    $(Self::$effect => Arc::new(crate::$module::$effect),)*
                }
            }
        }
    };
}
every_effect!(declare);

impl EffectId {
    /// The effect that it is a wider form of, or itself.
    pub fn narrowest(self) -> Self {
        self.effect().widens().unwrap_or(self)
    }
}

/// All effects, in the order of the list.
pub fn catalogue() -> [Arc<dyn Effect>; EffectId::COUNT] {
    EffectId::ALL.map(EffectId::effect)
}

/// The effect of the catalogue.
pub fn find(id: EffectId) -> Arc<dyn Effect> {
    id.effect()
}
