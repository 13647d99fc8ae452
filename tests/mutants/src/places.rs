//! Where a source can be changed by a hundredth: the constants, operators and indices of its functions.

use std::collections::BTreeSet;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};
use syn::{BinOp, Expr, Lit};

/// What is changed.
#[derive(Clone, Copy, Debug)]
enum Kind {
    Constant,
    Operator,
    Index,
}

/// A place. Its number is its index in the list of all.
pub struct Place {
    /// `file::function`, with the type of a method.
    pub body: String,
    /// Constant, operator or index.
    pub kind: String,
    /// Its line and the expression.
    pub text: String,
}

/// The names of constants of type `f32`.
pub fn float_constants(file: &syn::File) -> BTreeSet<String> {
    struct Names(BTreeSet<String>);
    impl<'a> Visit<'a> for Names {
        fn visit_item_const(&mut self, item: &'a syn::ItemConst) {
            if matches!(&*item.ty, syn::Type::Path(path) if path.path.is_ident("f32")) {
                self.0.insert(item.ident.to_string());
            }
        }
    }
    let mut names = Names(BTreeSet::new());
    names.visit_file(file);
    names.0
}

/// Adds the places of a source to the list, and returns the source in which each value passes through `near`.
pub fn rewrite(
    name: &str,
    source: &str,
    file: &syn::File,
    constants: &BTreeSet<String>,
    near: &str,
    places: &mut Vec<Place>,
) -> String {
    let mut search =
        Search { name, source, constants, path: Vec::new(), in_body: false, near, insertions: Vec::new(), places };
    search.visit_file(file);
    // Outer expressions come before the inner ones that begin at the same byte.
    search.insertions.sort_by_key(|(byte, _)| *byte);
    let (mut text, mut done) = (String::new(), 0);
    for (byte, insertion) in &search.insertions {
        text.push_str(&source[done..*byte]);
        text.push_str(insertion);
        done = *byte;
    }
    text + &source[done..]
}

struct Search<'a> {
    name: &'a str,
    source: &'a str,
    constants: &'a BTreeSet<String>,
    /// Type and function that are being read.
    path: Vec<String>,
    in_body: bool,
    near: &'a str,
    insertions: Vec<(usize, String)>,
    places: &'a mut Vec<Place>,
}

impl Search<'_> {
    fn add(&mut self, kind: Kind, expression: &Expr, suffix: &str) {
        let (span, bytes) = (expression.span(), expression.span().byte_range());
        self.insertions.push((bytes.start, format!("{}({}, ", self.near, self.places.len())));
        self.insertions.push((bytes.end, format!("{suffix})")));
        let words: Vec<&str> = self.source[bytes].split_whitespace().collect();
        let body = format!("{}::{}", self.name, self.path.join("::"));
        let text = format!("{} {}", span.start().line, words.join(" "));
        self.places.push(Place { body, kind: format!("{kind:?}").to_lowercase(), text });
    }

    fn index(&mut self, index: &Expr) {
        match index {
            Expr::Range(_) => {}
            Expr::Lit(literal) => {
                let has_suffix = matches!(&literal.lit, Lit::Int(number) if !number.suffix().is_empty());
                self.add(Kind::Index, index, if has_suffix { "" } else { "usize" });
            }
            index => self.add(Kind::Index, index, ""),
        }
    }

    fn function(&mut self, signature: &syn::Signature, visit: impl FnOnce(&mut Self)) {
        self.path.push(signature.ident.to_string());
        // What is computed at compile time cannot be changed at run time.
        let before = std::mem::replace(&mut self.in_body, signature.constness.is_none());
        visit(self);
        self.in_body = before;
        self.path.pop();
    }
}

impl<'a> Visit<'a> for Search<'_> {
    fn visit_item_fn(&mut self, item: &'a syn::ItemFn) {
        self.function(&item.sig, |search| search.visit_block(&item.block));
    }

    fn visit_impl_item_fn(&mut self, item: &'a syn::ImplItemFn) {
        self.function(&item.sig, |search| search.visit_block(&item.block));
    }

    fn visit_item_impl(&mut self, item: &'a syn::ItemImpl) {
        let name = match &*item.self_ty {
            syn::Type::Path(path) => path.path.segments.last().map(|segment| segment.ident.to_string()),
            _ => None,
        };
        self.path.push(name.unwrap_or_else(|| "impl".to_owned()));
        visit::visit_item_impl(self, item);
        self.path.pop();
    }

    fn visit_expr(&mut self, expression: &'a Expr) {
        if !self.in_body {
            return;
        }
        match expression {
            Expr::Lit(literal) if matches!(literal.lit, Lit::Float(_)) => self.add(Kind::Constant, expression, ""),
            Expr::Path(path)
                if path.path.get_ident().is_some_and(|name| self.constants.contains(&name.to_string())) =>
            {
                self.add(Kind::Constant, expression, "");
            }
            Expr::Binary(binary) => match binary.op {
                BinOp::Add(_) | BinOp::Sub(_) | BinOp::Mul(_) | BinOp::Div(_) | BinOp::Rem(_) => {
                    self.add(Kind::Operator, expression, "");
                }
                // What is added. A whole number is a step of a loop, which would not end.
                BinOp::AddAssign(_) | BinOp::SubAssign(_) | BinOp::MulAssign(_) | BinOp::DivAssign(_)
                    if !matches!(&*binary.right, Expr::Lit(_)) =>
                {
                    self.add(Kind::Operator, &binary.right, "");
                }
                _ => {}
            },
            Expr::Index(index) => self.index(&index.index),
            Expr::MethodCall(call) if call.method == "fetch" || call.method == "store" => {
                self.index(call.args.first().expect("an index"));
            }
            // What is computed at compile time.
            Expr::Const(_) => return,
            Expr::Repeat(repeat) => return self.visit_expr(&repeat.expr),
            _ => {}
        }
        visit::visit_expr(self, expression);
    }

    // Not expressions of a body.
    fn visit_pat(&mut self, _: &'a syn::Pat) {}
    fn visit_type(&mut self, _: &'a syn::Type) {}
    fn visit_generic_argument(&mut self, _: &'a syn::GenericArgument) {}
    fn visit_attribute(&mut self, _: &'a syn::Attribute) {}
    fn visit_item_const(&mut self, _: &'a syn::ItemConst) {}
}
