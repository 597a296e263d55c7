//! Bottles written as they read.

/// Builds a [`Bottle`](crate::Bottle) of the given values; square brackets nest a list.
///
/// Anything that converts into a [`Value`](crate::Value) is a value: integers, floats, text, vocabs, blobs, bottles.
///
/// ```
/// use yarp_wire::bottle;
///
/// let request = bottle!["set", "poss", [10.0, -20.5], 3];
/// assert_eq!(request.to_string(), "set poss (10.0 -20.5) 3");
/// assert!(bottle![].is_empty());
/// ```
#[macro_export]
macro_rules! bottle {
    (@push $bottle:ident) => {};
    (@push $bottle:ident [$($inner:tt)*] $(, $($rest:tt)*)?) => {
        $bottle.push($crate::Value::List($crate::bottle![$($inner)*]));
        $crate::bottle!(@push $bottle $($($rest)*)?);
    };
    (@push $bottle:ident $value:expr $(, $($rest:tt)*)?) => {
        $bottle.push($value);
        $crate::bottle!(@push $bottle $($($rest)*)?);
    };
    () => { $crate::Bottle::new() };
    ($($items:tt)+) => {{
        let mut bottle = $crate::Bottle::new();
        $crate::bottle!(@push bottle $($items)+);
        bottle
    }};
}
