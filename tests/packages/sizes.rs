//! How long functions are at most: what is longer does several things.

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use viewfuse_tests::places::repository;
use viewfuse_tests::source::files;

/// Lines of a function, from `fn` to its closing brace.
const MAX_FUNCTION_LINES: usize = 80;

/// The functions of a file that are longer than `most` lines.
fn long_functions(tokens: TokenStream, most: usize) -> Vec<String> {
    let mut found = Vec::new();
    // The function whose body is still to come.
    let mut begun: Option<(String, usize)> = None;
    let mut was_fn = None;
    for token in tokens {
        match token {
            TokenTree::Ident(word) => {
                if let Some(line) = was_fn.take() {
                    begun = Some((word.to_string(), line));
                }
                was_fn = (word == "fn").then(|| word.span().start().line);
            }
            TokenTree::Group(group) => {
                was_fn = None;
                if group.delimiter() == Delimiter::Brace
                    && let Some((name, start)) = begun.take()
                    && group.span_close().end().line + 1 - start > most
                {
                    found.push(name);
                }
                found.extend(long_functions(group.stream(), most));
            }
            TokenTree::Punct(mark) => {
                // Macros have `fn $name`.
                was_fn = was_fn.filter(|_| mark.as_char() == '$');
                if mark.as_char() == ';' {
                    begun = None;
                }
            }
            TokenTree::Literal(_) => was_fn = None,
        }
    }
    found
}

#[test]
fn functions_are_short() {
    let (mut found, mut count) = (Vec::new(), 0);
    for folder in ["core", "vulkan", "host", "tests"] {
        for path in files(&repository().join(folder), "rs") {
            let inside = path.strip_prefix(repository()).expect("inside").to_owned();
            let text = std::fs::read_to_string(&path).expect("a source");
            let tokens: TokenStream = text.parse().unwrap_or_else(|error| panic!("{error}: {}", path.display()));
            let long = long_functions(tokens, MAX_FUNCTION_LINES);
            found.extend(long.into_iter().map(|name| format!("{}: {name}", inside.display())));
            count += 1;
        }
    }
    assert_eq!(found, [""; 0], "functions of more than {MAX_FUNCTION_LINES} lines");
    assert!(count > 500, "{count} files");
}

#[test]
fn a_long_function_is_found() {
    let of = |text: &str| long_functions(text.parse().expect("tokens"), 3);
    assert_eq!(of("fn a() {\n    b();\n}\nfn c();\nstruct D {\n\n\n}\n"), [""; 0]);
    assert_eq!(of("fn a() {\n    b();\n    c();\n}\n"), ["a"]);
    assert_eq!(of("impl A {\n    fn inner<T: Fn(u32) -> B>(\n        self,\n    ) -> C {\n    }\n}\n"), ["inner"]);
    assert_eq!(of("mod m {\n    macro_rules! n {\n        () => {\n            fn $own() {\n\n\n            }\n        }\n    }\n}\n").len(), 1);
    // The type of a function has no body.
    assert_eq!(of("type A = fn(u32);\nstruct B {\n    a: fn(),\n\n\n}\n"), [""; 0]);
}
