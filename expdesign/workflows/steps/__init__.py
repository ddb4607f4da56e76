"""The steps that several commands share: values in, values out."""
