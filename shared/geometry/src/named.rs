//! Enums whose variants have names.

/// Defines an enum whose variants have the names that configurations, files and results have.
#[macro_export]
macro_rules! named {
    (
        $(#[$meta:meta])*
        pub enum $Named:ident {
            $($(#[$of_variant:meta])* $Variant:ident = $name:literal,)+
        }
    ) => {
        $(#[$meta])*
        pub enum $Named {
            $($(#[$of_variant])* $Variant,)+
        }

        impl $Named {
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$Variant),+];

            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$Variant => $name,)+
                }
            }

            pub fn by_name(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|it| it.name() == name)
            }
        }
    };
}
