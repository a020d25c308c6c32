//! `#[derive(DeserializeSpec)]`: the code of serde, once, for a deserialiser without a type parameter.

use proc_macro2::TokenStream;
use quote::{format_ident, quote};
use syn::{Attribute, Data, DeriveInput, Error, Fields, Path, parse_quote};

pub fn expand(input: DeriveInput) -> syn::Result<TokenStream> {
    if let Some(parameter) = input.generics.params.first() {
        return Err(Error::new_spanned(parameter, "a spec has no parameters"));
    }
    let models = models(&input.attrs)?;
    let name = input.ident.clone();
    // serde reads this copy of the type into the type itself.
    let mut copy = input;
    copy.ident = format_ident!("{name}Fields");
    let copied = &copy.ident;
    keep_serde(&mut copy.attrs);
    let remote = name.to_string();
    copy.attrs.push(parse_quote!(#[serde(remote = #remote)]));
    match &mut copy.data {
        Data::Struct(data) => keep_serde_of(&mut data.fields),
        Data::Enum(data) => {
            for variant in &mut data.variants {
                keep_serde(&mut variant.attrs);
                keep_serde_of(&mut variant.fields);
            }
        }
        Data::Union(_) => return Err(Error::new_spanned(&name, "a union is no spec")),
    }
    Ok(quote! {
        const _: () = {
            #[derive(::serde::Deserialize)]
            #copy

            #[automatically_derived]
            impl<'de> ::serde::Deserialize<'de> for #name {
                fn deserialize<D: ::serde::Deserializer<'de>>(deserializer: D) -> ::core::result::Result<Self, D::Error> {
                    #models::de::read(deserializer, |thin| #copied::deserialize(thin))
                }
            }
        };
    })
}

/// Where `fusion_models` is.
fn models(attributes: &[Attribute]) -> syn::Result<Path> {
    let mut models = parse_quote!(::fusion_models);
    for attribute in attributes.iter().filter(|attribute| attribute.path().is_ident("spec")) {
        attribute.parse_nested_meta(|meta| {
            if !meta.path.is_ident("models") {
                return Err(meta.error("there is no such attribute, only `models`"));
            }
            models = meta.value()?.parse()?;
            Ok(())
        })?;
    }
    Ok(models)
}

/// Removes the attributes of other derives.
fn keep_serde(attributes: &mut Vec<Attribute>) {
    attributes.retain(|attribute| attribute.path().is_ident("serde"));
}

fn keep_serde_of(fields: &mut Fields) {
    fields.iter_mut().for_each(|field| keep_serde(&mut field.attrs));
}
