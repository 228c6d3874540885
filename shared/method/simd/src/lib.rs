//! One attribute for the functions that are compiled once for each vector unit.

use proc_macro::TokenStream;

/// Compiles a function for AVX-512, for AVX2 and for NEON beside the baseline, and calls the best
/// variant that the processor supports.
///
/// The variants give the same bits as long as the function is plain Rust: the compiler never fuses
/// a multiplication with an addition unasked, and changes no order of operations. The crate that
/// uses the attribute depends on `multiversion`, whose macro this one fills in.
#[proc_macro_attribute]
pub fn simd(_: TokenStream, function: TokenStream) -> TokenStream {
    let attributes = r#"
        #[::multiversion::multiversion(targets(
            "x86_64+avx512f+avx512bw+avx512dq+avx512vl",
            "x86_64+avx2+fma",
            "aarch64+neon",
        ))]
    "#;
    let mut attributed: TokenStream = attributes.parse().expect("the attributes are Rust");
    attributed.extend(function);
    attributed
}
