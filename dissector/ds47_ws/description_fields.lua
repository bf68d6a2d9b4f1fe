-- The fields of a description (attribute 0x20) and of texts (0x30): key, label, kind, as fields.lua has them.
-- Which stands where is in description_tree.lua.

return {
  { "description", "Description", "string" },
  { "description.identifier", "Identifier", "uint16", "HEX" },
  { "description.type", "Type", "string" },
  { "description.writable", "Can be written", "bool" },
  { "description.text_array", "Has texts", "bool" },
  { "description.changed", "Not at its factory setting", "bool" },
  { "description.reset_only", "Can only be reset", "bool" },
  { "description.array", "Has elements", "bool" },
  { "description.elements", "Number of elements, or length", "uint16", "DEC" },
  { "description.factor", "Standardisation factor", "double" },
  { "description.quantity", "Variable index", "uint8", "DEC" },
  { "description.conversion", "Conversion index", "int8", "DEC" },
  { "description.unit", "Unit", "string" },
  { "description.name", "Name", "string" },
  { "description.low", "Lower limit", "double" },
  { "description.high", "Upper limit", "double" },
  { "description.extension", "Extension of the identifier", "uint16", "HEX" },
  { "description.reference", "Reference parameter", "uint16", "DEC" },
  { "description.normalisation", "Normalisation", "uint16", "HEX" },
  { "description.full_scale", "100 % in the value", "uint32", "HEX" },
  { "text", "Entry of a text array", "string" },
}
