# trilha_fonts(TARGET NAME FILE PACKAGE …): compiles the faces of type into the target, so that programs carry them and
# look the same on every machine. common/app/embedded_fonts.h declares them; a face that is not on this machine is
# empty there, and PACKAGE is named.
function(trilha_fonts target)
  set(triples ${ARGN})
  while(triples)
    list(POP_FRONT triples name file package)
    find_file(TRILHA_FONT_${name} ${file} DOC "The face of type ${file}"
      PATHS /usr/share/fonts/truetype/roboto/unhinted/RobotoTTF /usr/share/fonts/truetype/dejavu
            /usr/share/fonts/TTF /usr/share/fonts/dejavu /usr/share/fonts/dejavu-sans-mono-fonts
            /usr/share/fonts/google-roboto
      NO_DEFAULT_PATH)
    set(font ${TRILHA_FONT_${name}})
    if(NOT font)
      set(font "")
      message(WARNING "${file} was not found (Debian's package ${package}): windows will have a plainer face of type")
    endif()
    set(source ${PROJECT_BINARY_DIR}/fonts/${name}.cpp)
    set(script ${PROJECT_SOURCE_DIR}/cmake/embed_font.cmake)
    add_custom_command(OUTPUT ${source}
      COMMAND ${CMAKE_COMMAND} -D NAME=${name} -D "FONT=${font}" -D OUTPUT=${source} -P ${script}
      DEPENDS ${script} ${font} VERBATIM)
    target_sources(${target} PRIVATE ${source})
  endwhile()
endfunction()
