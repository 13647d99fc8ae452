//! Enums whose values a person chooses by their names: the names are written once, in `named!`.

/// A text is none of the names of an enum's values.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{given}' is not {kind}: {choices}")]
pub struct UnknownName {
    given: String,
    kind: &'static str,
    choices: String,
}

/// The value with this name: what `named!` reads with.
///
/// # Errors
/// [`UnknownName`] with all names, if it is none of them.
pub fn find<T: Copy>(
    given: &str,
    kind: &'static str,
    all: &[T],
    name: fn(T) -> &'static str,
) -> Result<T, UnknownName> {
    let found = all.iter().copied().find(|value| name(*value) == given);
    found.ok_or_else(|| {
        let mut choices = all.iter().map(|value| name(*value)).collect::<Vec<_>>().join(", ");
        if let Some(last) = choices.rfind(", ") {
            choices.replace_range(last..last + 2, " or ");
        }
        UnknownName { given: given.to_owned(), kind, choices }
    })
}

/// Gives an enum, which must be `Copy`, the list `ALL` of its values, in this order, their names as `name` and by
/// `Display`, and `FromStr`, whose error, [`UnknownName`](crate::named::UnknownName), says what the enum is and which
/// names there are. A value that is missing here does not compile; one that a build may lack has its `#[cfg(..)]` here,
/// too.
#[macro_export]
macro_rules! named {
    ($vis:vis $type:ident: $kind:literal { $($(#[$cfg:meta])* $value:ident => $name:literal),+ $(,)? }) => {
        impl $type {
            /// All of them that this build has.
            $vis const ALL: [$type; [$($(#[$cfg])* $type::$value),+].len()] = [$($(#[$cfg])* $type::$value),+];

            /// Its name.
            $vis const fn name(self) -> &'static str {
                match self {
                    $($(#[$cfg])* $type::$value => $name,)+
                }
            }
        }

        impl ::std::fmt::Display for $type {
            fn fmt(&self, formatter: &mut ::std::fmt::Formatter<'_>) -> ::std::fmt::Result {
                formatter.write_str(self.name())
            }
        }

        impl ::std::str::FromStr for $type {
            type Err = $crate::named::UnknownName;

            fn from_str(name: &str) -> ::std::result::Result<$type, $crate::named::UnknownName> {
                $crate::named::find(name, $kind, &$type::ALL, $type::name)
            }
        }
    };
}

#[cfg(test)]
mod tests {
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    enum Colour {
        Red,
        #[cfg(not(test))]
        Grey,
        DarkBlue,
        Green,
    }

    named! {
        Colour: "a colour" {
            Red => "red",
            #[cfg(not(test))]
            Grey => "grey",
            DarkBlue => "dark-blue",
            Green => "green",
        }
    }

    #[test]
    fn names_are_read_as_they_are_written() {
        assert_eq!(Colour::ALL, [Colour::Red, Colour::DarkBlue, Colour::Green]);
        assert_eq!(Colour::ALL.map(|colour| colour.to_string()), ["red", "dark-blue", "green"]);
        for colour in Colour::ALL {
            assert_eq!(colour.to_string().parse(), Ok(colour));
        }
        for text in ["Red", "grey", "dark", "green ", ""] {
            let error = text.parse::<Colour>().expect_err("no colour").to_string();
            assert_eq!(error, format!("'{text}' is not a colour: red, dark-blue or green"));
        }
    }
}
