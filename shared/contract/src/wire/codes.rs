//! Codes of a field, with their names.

/// Defines a module of codes, counted from 0, with the names that files and pages have.
macro_rules! codes {
    ($(
        $(#[doc = $doc:literal])*
        pub mod $module:ident: $number:ty {
            $($(#[doc = $of_code:literal])* $CODE:ident = $name:literal,)+
        }
    )*) => {
        $(
            $(#[doc = $doc])*
            pub mod $module {
                #[allow(clippy::upper_case_acronyms, non_camel_case_types)]
                enum Code {
                    $($CODE,)+
                }

                $($(#[doc = $of_code])* pub const $CODE: $number = Code::$CODE as $number;)+

                pub const NAMES: &[&str] = &[$($name),+];

                /// Returns the name of a code; `unknown` beyond the last one.
                pub fn name(code: $number) -> &'static str {
                    NAMES.get(code as usize).unwrap_or(&"unknown")
                }
            }
        )*
    };
}
pub(crate) use codes;
