//! The derive macro for typed YARP messages, re-exported by `yarp-client`.

use proc_macro2::TokenStream;
use quote::quote;
use syn::{Data, DeriveInput, Fields, parse_macro_input};

/// Implements a typed message for a struct with named fields.
///
/// The message travels as the list of its fields in their order, so that stock tools print it and stock's interface
/// compiler reads it. Each field needs the trait `Field` of `yarp_client`. A received list of another length, or with a
/// value of another kind, is an error of decoding.
#[proc_macro_derive(Message)]
pub fn derive_message(input: proc_macro::TokenStream) -> proc_macro::TokenStream {
    let input = parse_macro_input!(input as DeriveInput);
    expand(&input)
        .unwrap_or_else(syn::Error::into_compile_error)
        .into()
}

fn expand(input: &DeriveInput) -> syn::Result<TokenStream> {
    let fields = named_fields(input)?;
    if let Some(parameter) = input.generics.params.first() {
        return Err(syn::Error::new_spanned(
            parameter,
            "a message has no generic parameters: its layout on the wire is fixed",
        ));
    }
    let name = &input.ident;
    let idents: Vec<_> = fields.iter().map(|field| &field.0).collect();
    let types: Vec<_> = fields.iter().map(|field| &field.1).collect();
    Ok(quote! {
        impl ::yarp_client::wire::typed::Record for #name {
            const SHAPE: &'static str = concat!(
                stringify!(#name),
                #(" ", stringify!(#idents), ": ", stringify!(#types),)*
            );

            fn to_bottle(&self) -> ::yarp_client::Bottle {
                ::yarp_client::Bottle::new()
                    #(.with(::yarp_client::wire::typed::Field::to_value(&self.#idents)))*
            }

            fn from_bottle(bottle: &::yarp_client::Bottle) -> Option<Self> {
                let mut items = bottle.iter();
                let record = Self {
                    #(#idents: ::yarp_client::wire::typed::Field::from_value(items.next()?)?,)*
                };
                items.next().is_none().then_some(record)
            }
        }

        ::yarp_client::wire::wire_record!(#name);
    })
}

/// Returns name and type of each field.
fn named_fields(input: &DeriveInput) -> syn::Result<Vec<(syn::Ident, syn::Type)>> {
    let refused = || {
        syn::Error::new_spanned(
            &input.ident,
            "a message is a struct with at least one named field",
        )
    };
    let Data::Struct(data) = &input.data else {
        return Err(refused());
    };
    let Fields::Named(named) = &data.fields else {
        return Err(refused());
    };
    if named.named.is_empty() {
        return Err(refused());
    }
    let each = named.named.iter();
    Ok(each
        .filter_map(|field| Some((field.ident.clone()?, field.ty.clone())))
        .collect())
}
