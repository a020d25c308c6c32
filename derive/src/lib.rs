//! `#[derive(Literal)]` for the models of the fusion framework. Import it with the trait, as
//! `fusion_core::model::Literal`; its documentation has an example.
//!
//! `#[derive(DeserializeSpec)]` for their specs, as `fusion_models::de::DeserializeSpec`.

mod spec;

use proc_macro2::TokenStream;
use quote::{format_ident, quote};
use syn::{Data, DeriveInput, Error, Fields, Ident, LitStr, Member, Path, Type, WherePredicate, parse_quote};

/// Writes `fusion_core::model::Literal` for a struct or an enum, field by field.
///
/// A struct also gets a hidden constructor `const fn from_literal`, which takes its fields in order. The expression
/// calls it by the path of the module, so type and module must be public, and so must the types of the fields.
///
/// | attribute | meaning |
/// |---|---|
/// | `#[literal(at = "a::b")]` | the public path of the module, if the type is re-exported from a private module |
/// | `#[literal(core = fusion::core)]` | where `fusion_core` is, in a crate that does not depend on it directly |
#[proc_macro_derive(Literal, attributes(literal))]
pub fn literal(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let input = syn::parse_macro_input!(input as DeriveInput);
    expand(&input).unwrap_or_else(Error::into_compile_error).into()
}

/// Writes `serde::Deserialize` for a spec, as serde does, with much less code in the program.
///
/// It takes the attributes of serde. `#[spec(models = a::b)]` says where `fusion_models` is, in a crate that does not
/// depend on it directly.
#[proc_macro_derive(DeserializeSpec, attributes(serde, spec))]
pub fn deserialize_spec(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let input = syn::parse_macro_input!(input as DeriveInput);
    spec::expand(input).unwrap_or_else(Error::into_compile_error).into()
}

fn expand(input: &DeriveInput) -> syn::Result<TokenStream> {
    let (core, module) = attributes(input)?;
    let (name, literal) = (&input.ident, quote!(#core::model::literal));
    let path = quote!("::", #module, "::", ::core::stringify!(#name));
    let (parts, body, constructor) = match &input.data {
        Data::Struct(data) => {
            let parts = Parts::of(&data.fields);
            let (members, value, function) = (&parts.members, parts.within(&quote!(Self)), quote!(#path, "::from_literal"));
            let Parts { names, types, .. } = &parts;
            if matches!(data.fields, Fields::Unit) {
                (vec![parts], quote!(out.push_str(::core::concat!(#path));), None)
            } else {
                let body = quote!(#literal::call(out, ::core::concat!(#function), &[#(&self.#members),*]););
                let constructor = quote! {
                    #[doc(hidden)]
                    #[must_use]
                    #[allow(clippy::too_many_arguments, reason = "one per field")]
                    pub const fn from_literal(#(#names: #types),*) -> Self {
                        #value
                    }
                };
                (vec![parts], body, Some(constructor))
            }
        }
        Data::Enum(data) => {
            let parts: Vec<Parts> = data.variants.iter().map(|variant| Parts::of(&variant.fields)).collect();
            let arms = data.variants.iter().zip(&parts).map(|(variant, parts)| {
                let (name, names, members) = (&variant.ident, &parts.names, &parts.members);
                let path = quote!(::core::concat!(#path, "::", ::core::stringify!(#name)));
                let writing = match variant.fields {
                    Fields::Unit => quote!(out.push_str(#path)),
                    Fields::Unnamed(_) => quote!(#literal::call(out, #path, &[#(#names),*])),
                    Fields::Named(_) => quote!(#literal::fields(out, #path, &[#((::core::stringify!(#members), #names)),*])),
                };
                let pattern = parts.within(&quote!(Self::#name));
                quote!(#pattern => #writing,)
            });
            let body = quote!(match self { #(#arms)* });
            (parts, body, None)
        }
        Data::Union(_) => return Err(Error::new(name.span(), "a union has no literal")),
    };
    let mut bounded = input.generics.clone();
    if bounded.type_params().next().is_some() {
        let types = parts.iter().flat_map(|parts| &parts.types);
        let bounds = types.map(|of| -> WherePredicate { parse_quote!(#of: #literal::Literal) });
        bounded.make_where_clause().predicates.extend(bounds);
    }
    let (generics, parameters, given) = input.generics.split_for_impl();
    let bounds = &bounded.where_clause;
    let constructor = constructor.map(|constructor| quote!(impl #generics #name #parameters #given { #constructor }));
    Ok(quote! {
        #[automatically_derived]
        impl #generics #literal::Literal for #name #parameters #bounds {
            fn expression(&self, out: &mut #literal::String) {
                #body
            }
        }
        #constructor
    })
}

/// Where `fusion_core` is, and the module of the type as a string expression.
fn attributes(input: &DeriveInput) -> syn::Result<(Path, TokenStream)> {
    let (mut core, mut module): (Path, _) = (parse_quote!(::fusion_core), quote!(::core::module_path!()));
    for attribute in input.attrs.iter().filter(|attribute| attribute.path().is_ident("literal")) {
        attribute.parse_nested_meta(|meta| {
            if meta.path.is_ident("core") {
                core = meta.value()?.parse()?;
            } else if meta.path.is_ident("at") {
                let path: LitStr = meta.value()?.parse()?;
                module = quote!(#path);
            } else {
                return Err(meta.error("there is no such attribute, only `at` and `core`"));
            }
            Ok(())
        })?;
    }
    Ok((core, module))
}

/// The fields of a struct or of a variant, with a variable for each.
struct Parts {
    members: Vec<Member>,
    names: Vec<Ident>,
    types: Vec<Type>,
}

impl Parts {
    fn of(fields: &Fields) -> Self {
        Self {
            members: fields.members().collect(),
            names: (0..fields.len()).map(|i| format_ident!("field_{i}")).collect(),
            types: fields.iter().map(|field| field.ty.clone()).collect(),
        }
    }

    /// `of` with these variables: a pattern, or a value.
    fn within(&self, of: &TokenStream) -> TokenStream {
        let Self { members, names, .. } = self;
        quote!(#of { #(#members: #names),* })
    }
}
