# The three kinds of target. Sources listed after PASSES launch passes: nvcc compiles them where CUDA is on, the C++
# compiler where it is not. Sources listed after PLAIN never meet nvcc.

function(trilha_sources target)
  cmake_parse_arguments(arg "" "" "PASSES;PLAIN" ${ARGN})
  target_sources(${target} PRIVATE ${arg_PASSES} ${arg_PLAIN})
  if(TRILHA_HAS_CUDA AND arg_PASSES)
    set_source_files_properties(${arg_PASSES} PROPERTIES LANGUAGE CUDA)
  endif()
  target_include_directories(${target} PUBLIC ${PROJECT_SOURCE_DIR})
endfunction()

# trilha_library(NAME PASSES … PLAIN … LINK …)
function(trilha_library name)
  cmake_parse_arguments(arg "" "" "PASSES;PLAIN;LINK" ${ARGN})
  add_library(${name} STATIC)
  trilha_sources(${name} PASSES ${arg_PASSES} PLAIN ${arg_PLAIN})
  target_link_libraries(${name} PUBLIC ${arg_LINK})
endfunction()

# trilha_chapter(PASSES … PLAIN … LINK …), in the chapter's folder: a library and, from main.cpp, a program.
function(trilha_chapter)
  cmake_parse_arguments(arg "" "" "PASSES;PLAIN;LINK" ${ARGN})
  get_filename_component(name ${CMAKE_CURRENT_SOURCE_DIR} NAME)
  trilha_library(chapter_${name} PASSES ${arg_PASSES} PLAIN ${arg_PLAIN} LINK trilha_app ${arg_LINK})
  add_executable(${name} main.cpp)
  target_link_libraries(${name} PRIVATE chapter_${name})
endfunction()

# trilha_test(NAME PASSES … PLAIN … LINK … [ALONE] [DEEP]): a Catch2 program; ctest knows every test case of it by its
# own name. A case that finds no GPU says so (require_cuda) and is reported as skipped. ALONE: nothing runs beside it.
# DEEP: only `./trilha test --deep` runs it.
function(trilha_test name)
  cmake_parse_arguments(arg "ALONE;DEEP" "" "PASSES;PLAIN;LINK" ${ARGN})
  add_executable(${name})
  trilha_sources(${name} PASSES ${arg_PASSES} PLAIN ${arg_PLAIN})
  target_link_libraries(${name} PRIVATE trilha_testing ${arg_LINK})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  set(label "")
  if(arg_DEEP)
    set(label LABELS deep)
  endif()
  catch_discover_tests(${name} TEST_PREFIX "${name}:"
    PROPERTIES SKIP_REGULAR_EXPRESSION "TRILHA SKIPPED" TIMEOUT 300 RUN_SERIAL ${arg_ALONE} ${label})
endfunction()
